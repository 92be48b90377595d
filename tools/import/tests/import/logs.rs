//! Foreign logs become frames: clocks, counters, units, delays, and what is refused.
use std::fmt::Write as _;
use std::fs;
use std::path::Path;

use tempfile::TempDir;
use vigil_import::{ImportedRun, LogDescription, import};
use vigil_robot::Description;
use vigil_robot::description::Kinematics;

const LOG: &str = r#"
robot = "robot.toml"
rate_hz = 50.0
runs = ["run*"]
[[source]]
name = "base"
file = "base.csv"
delimiter = ";"
skip_rows = 1
time = { column = "stamp", unit = "ms" }
device_clock = { column = "ticks_ms", unit = "ms", modulus = 1000 }
[[source]]
name = "gyro"
file = "gyro.csv"
time = { column = "t", unit = "s" }
[[channel]]
name = "v"
source = "base"
column = "v"
method = "hold"
[[channel]]
name = "w"
source = "base"
column = "w"
method = "hold"
[[channel]]
name = "enc_L"
source = "base"
column = "left"
modulus = 4096
differentiate = true
scale = 0.001
method = "interpolate"
[[channel]]
name = "enc_R"
source = "base"
column = "right"
modulus = 4096
differentiate = true
scale = -0.001
method = "interpolate"
[[channel]]
name = "yaw_rate"
source = "gyro"
column = "rate"
unit = "deg"
method = "interpolate"
delay_s = "estimate"
delay_against = { enc_R = 1.0, enc_L = -1.0 }
"#;

fn robot() -> Description {
    toml::from_str(
        r#"
name = "small"
kinematics = "differential"
wheel_radius_m = 0.1
noise = "estimate"
command = [{ name = "v", unit = "m/s", limit = 1.0 }, { name = "w", unit = "rad/s", limit = 2.0 }]
wheels = [
  { name = "L", x = 0.0, y = 0.1, steered = false },
  { name = "R", x = 0.0, y = -0.1, steered = false },
]
measured = { pose = false, wheel_rates = true, steer = false, yaw_rate = true, currents = false }
limits = { speed_m_s = 1.0, yaw_rate_rad_s = 2.0, wheel_rate_rad_s = 50.0 }
"#,
    )
    .unwrap()
}

/// Rate of a wheel, rad/s, and its turns since 0, rad.
fn wheel(t: f64, side: f64) -> (f64, f64) {
    let (rate, turned) = (
        5.0 + side * (3.0 * t).sin(),
        5.0 * t - side * ((3.0 * t).cos() - 1.0) / 3.0,
    );
    (rate, turned)
}

/// A run of 10 s, whose gyro is 120 ms late; `spoil` may change the base's text.
fn write(folder: &Path, spoil: impl Fn(String) -> String) {
    fs::create_dir_all(folder).unwrap();
    let mut base = "made by nobody\nstamp;ticks_ms;left;right;v;w;\n".to_owned();
    let mut gyro = "t,rate\n".to_owned();
    for i in 0..500_u32 {
        let t = f64::from(i) * 0.02;
        let count = |side| (wheel(t, side).1 * 1000.0).round() as i64;
        // The right wheel counts backwards; the stamp jitters by 3 ms, the device's clock does not.
        let (left, right) = (count(1.0).rem_euclid(4096), (-count(-1.0)).rem_euclid(4096));
        let stamp = 50_000 + i * 20 + [0, 3, 1][i as usize % 3];
        writeln!(
            base,
            "{stamp};{};{left};{right};0.5;{};",
            (i * 20 + 900) % 1000,
            i % 7
        )
        .unwrap();
        let late = t - 0.12;
        let rate = (wheel(late, -1.0).0 - wheel(late, 1.0).0) * 0.1 / 0.2;
        writeln!(gyro, "{},{}", 50.0 + t, rate.to_degrees()).unwrap();
    }
    fs::write(folder.join("base.csv"), spoil(base)).unwrap();
    fs::write(folder.join("gyro.csv"), gyro).unwrap();
}

fn log() -> LogDescription {
    toml::from_str(LOG).unwrap()
}

#[test]
fn counters_clocks_units_and_delays_come_out_right() {
    let folder = TempDir::new().unwrap();
    for run in ["run1", "run0", "other"] {
        write(&folder.path().join(run), |text| text);
    }
    let imported = import(&log(), &robot(), folder.path()).unwrap();
    let names: Vec<&str> = imported.runs.iter().map(|run| run.name.as_str()).collect();
    assert_eq!(names, ["run0", "run1"]);
    assert_eq!(imported.columns, ["v", "w", "enc_L", "enc_R", "yaw_rate"]);
    let (channel, delay_s) = &imported.delays_s[0];
    assert_eq!(channel, "yaw_rate");
    // A difference of counts is the rate half a step earlier.
    assert!((delay_s - 0.11).abs() < 0.011, "{delay_s}");
    let rows = &imported.runs[0].rows;
    assert!(rows.len() > 450, "{}", rows.len());
    let mut compared = 0;
    for row in rows.iter().skip(5).take(400) {
        let [_, v, _, left, right, yaw_rate] = row[..] else {
            unreachable!("six values")
        };
        assert!((v - 0.5).abs() < 1e-12);
        assert!((left + right - 10.0).abs() < 0.15, "{row:?}");
        assert!((yaw_rate - (right - left) * 0.5).abs() < 0.1, "{row:?}");
        compared += 1;
    }
    assert_eq!(compared, 400);
}

#[test]
fn the_first_frames_do_not_depend_on_what_comes_later() {
    let folder = TempDir::new().unwrap();
    write(&folder.path().join("run0"), |text| text);
    let whole = import(&log(), &robot(), folder.path()).unwrap();
    write(&folder.path().join("run0"), |text| {
        text.lines()
            .take(302)
            .fold(String::new(), |all, line| all + line + "\n")
    });
    // The offset and rate of the device's clock and the delay are constants of the log: given here.
    let mut log = log();
    log.source[0].device_clock = None;
    log.channel[4].delay_s = vigil_import::Delay::Given(0.1);
    let cut = import(&log, &robot(), folder.path()).unwrap();
    write(&folder.path().join("run0"), |text| text);
    let uncut = import(&log, &robot(), folder.path()).unwrap();
    let length = cut.runs[0].rows.len();
    assert!(length > 250 && length < whole.runs[0].rows.len());
    assert_eq!(cut.runs[0].rows[..], uncut.runs[0].rows[..length]);
}

#[test]
fn what_does_not_fit_is_refused_with_its_place() {
    let refused = |spoil: &dyn Fn(String) -> String| {
        let folder = TempDir::new().unwrap();
        write(&folder.path().join("run0"), spoil);
        let mut log = log();
        log.channel[4].delay_s = vigil_import::Delay::Given(0.1);
        import(&log, &robot(), folder.path())
            .unwrap_err()
            .to_string()
    };
    let message = refused(&|text| text.replacen(";0.5;3;", ";fast;3;", 1));
    assert!(
        message.contains("base.csv: row 4") && message.contains("v is 'fast'"),
        "{message}"
    );
    let message = refused(&|text| text.replace("left", "links"));
    assert!(
        message.contains("there is no column 'left'; there are stamp, ticks_ms"),
        "{message}"
    );
    let message = refused(&|text| {
        text.lines()
            .take(20)
            .fold(String::new(), |a, l| a + l + "\n")
    });
    assert!(message.contains("less than 1 s in common"), "{message}");

    let folder = TempDir::new().unwrap();
    let message = import(&log(), &robot(), folder.path())
        .unwrap_err()
        .to_string();
    assert!(message.contains("nothing there matches run*"), "{message}");
    let mut wrong = log();
    wrong.channel.pop();
    let message = import(&wrong, &robot(), folder.path())
        .unwrap_err()
        .to_string();
    assert!(
        message.contains("yaw_rate is described 0 times"),
        "{message}"
    );
    let mut wrong = log();
    wrong.channel[0].name = "speed".into();
    let message = import(&wrong, &robot(), folder.path())
        .unwrap_err()
        .to_string();
    assert!(
        message.contains("no channel 'speed': allowed are v, w, enc_L"),
        "{message}"
    );
}

#[test]
fn numbers_and_units_that_make_no_sense_are_refused_by_their_keys() {
    let folder = TempDir::new().unwrap();
    write(&folder.path().join("run0"), |text| text);
    let cases = [
        (
            "modulus = 1000",
            "modulus = 0",
            "source.0.device_clock.modulus: 0",
        ),
        ("modulus = 4096", "modulus = 0.0", "channel.2.modulus: 0"),
        (
            "modulus = 4096",
            "modulus = -4096",
            "channel.2.modulus: -4096",
        ),
        ("modulus = 4096", "modulus = inf", "channel.2.modulus: inf"),
        ("modulus = 4096", "modulus = nan", "channel.2.modulus: NaN"),
        ("scale = 0.001", "scale = nan", "channel.2.scale: NaN"),
        ("scale = 0.001", "scale = 0", "channel.2.scale: 0"),
        ("scale = 0.001", "offset = inf", "channel.2.offset: inf"),
        (
            "column = \"v\"",
            "column = \"v\"\ninitial = nan",
            "channel.0.initial: NaN",
        ),
        (
            "enc_L = -1.0",
            "enc_L = nan",
            "channel.4.delay_against.enc_L: NaN",
        ),
        (
            "unit = \"s\"",
            "unit = \"deg\"",
            "source.1.time.unit: is no unit of time",
        ),
        (
            "unit = \"deg\"",
            "unit = \"ms\"",
            "channel.4.unit: is a unit of time",
        ),
        (
            "rate_hz = 50.0",
            "rate_hz = 50.0\nhold_max_s = 0",
            "hold_max_s: 0",
        ),
    ];
    for (from, to, wanted) in cases {
        let text = LOG.replacen(from, to, 1);
        assert_ne!(text, LOG, "{from}");
        let log: LogDescription = toml::from_str(&text).unwrap();
        let refused = import(&log, &robot(), folder.path());
        let message = refused.map(|_| ()).unwrap_err().to_string();
        assert!(message.starts_with(wanted), "{to}: {message}");
    }
}

#[test]
fn a_command_is_not_held_for_ever() {
    // The commands' topic ends after 2 of 10 s: by itself, in a file of its own.
    let folder = TempDir::new().unwrap();
    let run = folder.path().join("run0");
    write(&run, |text| text);
    let commands = (0..100).map(|i| format!("{},0.5\n", 50.0 + f64::from(i) * 0.02));
    fs::write(
        run.join("commands.csv"),
        format!("t,v\n{}", commands.collect::<String>()),
    )
    .unwrap();
    let source = "[[source]]\nname = \"commands\"\nfile = \"commands.csv\"\n\
                  time = { column = \"t\", unit = \"s\" }\n[[channel]]";
    let text = LOG.replacen("[[channel]]", source, 1);
    let text = text.replacen("source = \"base\"", "source = \"commands\"", 1);
    let mut log: LogDescription = toml::from_str(&text).unwrap();
    assert_eq!(log.hold_max_s, 30.0);
    assert!(import(&log, &robot(), folder.path()).is_ok());
    log.hold_max_s = 5.0;
    let message = import(&log, &robot(), folder.path())
        .unwrap_err()
        .to_string();
    assert!(
        message.contains("commands.csv: row 100: column v: its value is held for 7.")
            && message.contains("hold_max_s allows 5 s"),
        "{message}"
    );
    log.hold_max_s = f64::INFINITY;
    assert!(import(&log, &robot(), folder.path()).is_ok());
}

#[test]
fn the_shipped_descriptions_can_be_read() {
    let config = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../config");
    for name in ["kobuki", "robotino"] {
        let path = config.join(format!("logs/{name}.toml"));
        let log = LogDescription::load(&path).unwrap();
        let text = fs::read_to_string(log.robot_path(&path)).unwrap();
        let robot: Description = toml::from_str(&text).unwrap();
        assert_eq!(robot.name, name);
    }
}

#[test]
fn what_follows_a_long_pause_is_a_run_of_its_own() {
    // Nothing is measured for three seconds, then the gyro alone is silent for as long.
    let [whole, paused] = [[-1.0; 2], [53.0, 56.0]].map(|pause| with_pauses(pause, pause));
    assert_eq!((whole.len(), paused.len()), (1, 2));
    assert_eq!((paused[0].id, paused[1].id), (0, 1));
    assert_eq!(paused[0].name, "run0");
    let since = paused[1].name.strip_prefix("run0, ").unwrap();
    let since_s: f64 = since.strip_suffix(" s on").unwrap().parse().unwrap();
    assert!((since_s - 6.0).abs() < 0.05, "{since}");
    let times = paused.iter().map(|run| run.rows[0][0]);
    assert_eq!(times.collect::<Vec<_>>(), [0.0; 2]);
    let lost = whole[0].rows.len() - paused[0].rows.len() - paused[1].rows.len();
    assert!((145..=152).contains(&lost), "{lost}");
    // What was measured after the pause is what the whole log has there.
    assert_eq!(
        paused[1].rows.last().unwrap()[1..],
        whole[0].rows.last().unwrap()[1..]
    );
    let partly = with_pauses([-1.0; 2], [53.0, 56.0]);
    assert_eq!(
        (partly.len(), partly[0].rows.len()),
        (1, whole[0].rows.len())
    );
}

#[test]
fn a_gap_of_the_rovers_channels_is_told_by_file_row_and_column_of_the_user() {
    let folder = TempDir::new().unwrap();
    // Rows 200 to 259 are missing; row 100 comes twice.
    write(&folder.path().join("run0"), |text| {
        let lines: Vec<&str> = text.lines().collect();
        let kept = [&lines[..102], &lines[101..201], &lines[261..]].concat();
        kept.iter()
            .fold(String::new(), |all, line| all + line + "\n")
    });
    let mut log = log();
    log.channel[4].delay_s = vigil_import::Delay::Given(0.1);
    log.source[0].device_clock = None;
    let robot = Description {
        kinematics: Kinematics::Ackermann6,
        ..robot()
    };
    let message = import(&log, &robot, folder.path()).unwrap_err().to_string();
    // Two lines before the first row, and the row that comes twice: the one after the gap is 201.
    assert!(
        message.contains("run0/base.csv: row 201: column left: a gap of 1.2"),
        "{message}"
    );
}

#[test]
fn rows_out_of_order_are_put_in_order_and_counted() {
    let folder = TempDir::new().unwrap();
    write(&folder.path().join("run0"), |text| text);
    let gyro = folder.path().join("run0/gyro.csv");
    let text = fs::read_to_string(&gyro).unwrap();
    let mut lines: Vec<&str> = text.lines().collect();
    lines.swap(100, 102);
    lines.swap(300, 301);
    let mut log = log();
    log.channel[4].delay_s = vigil_import::Delay::Given(0.1);
    let ordered = import(&log, &robot(), folder.path()).unwrap();
    assert!(ordered.runs[0].disorder.is_empty());
    fs::write(&gyro, lines.join("\n")).unwrap();
    let found = import(&log, &robot(), folder.path()).unwrap();
    assert_eq!(found.runs[0].rows, ordered.runs[0].rows);
    let [disorder] = &found.runs[0].disorder[..] else {
        unreachable!("one clock is out of order")
    };
    assert!(disorder.path.ends_with("run0/gyro.csv") && disorder.column == "t");
    // 102 101 100 goes back twice, 301 300 once.
    assert_eq!((disorder.rows, disorder.first_row), (3, 101));
    assert!((disorder.back_s - 0.02).abs() < 1e-9, "{disorder:?}");
}

/// What is made of a run whose rows within these times, s, were not written.
fn with_pauses(base: [f64; 2], gyro: [f64; 2]) -> Vec<ImportedRun> {
    let folder = TempDir::new().unwrap();
    let run = folder.path().join("run0");
    write(&run, |text| text);
    let cut = |name: &str, skipped: usize, separator: char, scale: f64, [from, to]: [f64; 2]| {
        let path = run.join(name);
        let text = fs::read_to_string(&path).unwrap();
        let is_kept = |(i, line): &(usize, &str)| {
            let t_s = |line: &str| {
                line.split(separator)
                    .next()
                    .unwrap()
                    .parse::<f64>()
                    .unwrap()
            };
            *i < skipped || !(from..to).contains(&(t_s(line) * scale))
        };
        let kept = text.lines().enumerate().filter(is_kept);
        let kept: Vec<&str> = kept.map(|(_, line)| line).collect();
        fs::write(&path, kept.join("\n")).unwrap();
    };
    cut("base.csv", 2, ';', 1e-3, base);
    cut("gyro.csv", 1, ',', 1.0, gyro);
    let mut log = log();
    // The command is that of the base: no time in which nothing is measured counts as held.
    log.hold_max_s = 1.0;
    // Both clocks as they are, and none that wraps within a pause.
    log.source[0].device_clock = None;
    for channel in &mut log.channel {
        channel.delay_s = vigil_import::Delay::Given(0.0);
    }
    import(&log, &robot(), folder.path()).unwrap().runs
}

#[test]
fn what_was_not_measured_in_a_pause_is_not_made_up() {
    let never = [-1.0, -1.0];
    let rows = |base, gyro| with_pauses(base, gyro)[0].rows.clone();
    let whole = rows(never, never);
    assert!(whole.iter().flatten().all(|value| value.is_finite()));
    // The gyro alone is silent for a quarter of a second: columns v, w, enc_L, enc_R, yaw_rate.
    let pause = [53.0, 53.25];
    let partly = rows(never, pause);
    assert_eq!(partly.len(), whole.len());
    let silent = partly.iter().filter(|row| row[5].is_nan()).count();
    assert!((9..=13).contains(&silent), "{silent}");
    assert!(
        partly
            .iter()
            .all(|row| row[3].is_finite() && row[1].is_finite())
    );
    // Nothing is measured: there is no frame.
    let none = rows(pause, pause);
    let lost = whole.len() - none.len();
    assert!((8..=13).contains(&lost), "{lost}");
    let longest = none.windows(2).map(|pair| pair[1][0] - pair[0][0]);
    assert!(longest.fold(0.0, f64::max) > 0.15);
}
