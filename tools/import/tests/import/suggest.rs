//! Descriptions suggested from logs of known robots, and what is found wrong in imported ones.
use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::fs;
use std::path::Path;

use mcap::records::MessageHeader;
use tempfile::TempDir;
use vigil_import::{ImportedLog, LogDescription, Suggestion, agreements, import, suggest, survey};
use vigil_robot::Description;

const RADIUS_M: f64 = 0.08;
const TRACK_M: f64 = 0.5;

/// Speed m/s and yaw rate rad/s of a drive with turns both ways.
fn drive(t_s: f64) -> (f64, f64) {
    (0.4 * (0.3 * t_s).sin(), 0.8 * (0.17 * t_s).sin())
}

/// Rate of a wheel, rad/s; `side` is 1 left, -1 right.
fn wheel(t_s: f64, side: f64) -> f64 {
    let (v, w) = drive(t_s);
    (v - side * w * TRACK_M / 2.0) / RADIUS_M
}

/// CDR, little-endian.
#[derive(Default)]
struct Cdr(Vec<u8>);

impl Cdr {
    fn number(&mut self, bytes: &[u8]) {
        while !self.0.len().is_multiple_of(bytes.len()) {
            self.0.push(0);
        }
        self.0.extend(bytes);
    }

    fn floats(&mut self, values: impl IntoIterator<Item = f64>) {
        values
            .into_iter()
            .for_each(|value| self.number(&value.to_le_bytes()));
    }

    fn text(&mut self, text: &str) {
        self.number(&(text.len() as u32 + 1).to_le_bytes());
        self.0.extend(text.bytes().chain([0]));
    }

    fn header(&mut self, t_ns: u64) {
        self.number(&((t_ns / 1_000_000_000) as u32).to_le_bytes());
        self.number(&((t_ns % 1_000_000_000) as u32).to_le_bytes());
        self.text("base_link");
    }

    fn message(self) -> Vec<u8> {
        [&[0, 1, 0, 0], self.0.as_slice()].concat()
    }
}

const PACK: &str = "std_msgs/Header header\nCell[2] cells\n===\nMSG: my_msgs/Cell\n\
                    bool is_on\nfloat32 voltage\n";

/// Four wheels, of which the right ones turn backwards.
fn joints(t_s: f64, t_ns: u64) -> Cdr {
    let mut joints = Cdr::default();
    joints.header(t_ns);
    joints.number(&4_u32.to_le_bytes());
    ["fl", "fr", "rl", "rr"]
        .iter()
        .for_each(|name| joints.text(name));
    joints.number(&0_u32.to_le_bytes());
    joints.number(&4_u32.to_le_bytes());
    let (left, right) = (wheel(t_s, 1.0), -wheel(t_s, -1.0));
    joints.floats([left, right, left, right]);
    joints.number(&0_u32.to_le_bytes());
    joints
}

fn imu(t_s: f64, t_ns: u64) -> Cdr {
    let mut imu = Cdr::default();
    imu.header(t_ns);
    imu.floats([0.0, 0.0, 0.0, 1.0]);
    imu.floats([0.0; 9]);
    imu.floats([0.0, 0.0, drive(t_s).1]);
    imu.floats([0.0; 9]);
    imu.floats([0.1 * t_s.cos(), 0.0, 9.81]);
    imu.floats([0.0; 9]);
    imu
}

/// A minute of a robot with four wheels, of which the right ones turn backwards.
fn bag(path: &Path) {
    let file = fs::File::create(path).unwrap();
    let options = mcap::WriteOptions::new().compression(None);
    let mut writer = options.create(file).unwrap();
    let mut channels = BTreeMap::new();
    for (topic, kind, text) in [
        ("/joint_states", "sensor_msgs/msg/JointState", ""),
        ("/cmd_vel", "geometry_msgs/msg/Twist", ""),
        ("/imu", "sensor_msgs/msg/Imu", ""),
        ("/pack", "my_msgs/msg/Pack", PACK),
        ("/secret", "my_msgs/msg/Unknown", ""),
    ] {
        let schema = writer.add_schema(kind, "ros2msg", text.as_bytes()).unwrap();
        let channel = writer
            .add_channel(schema, topic, "cdr", &BTreeMap::new())
            .unwrap();
        channels.insert(topic, channel);
    }
    for i in 0..3000_u32 {
        let t_s = f64::from(i) * 0.02;
        let t_ns = 1_700_000_000_000_000_000 + u64::from(i) * 20_000_000;
        let mut sent = vec![
            ("/joint_states", joints(t_s, t_ns)),
            ("/imu", imu(t_s, t_ns)),
        ];
        if i % 2 == 0 {
            let mut twist = Cdr::default();
            let (v, w) = drive(t_s);
            twist.floats([v, 0.0, 0.0, 0.0, 0.0, w]);
            let mut pack = Cdr::default();
            pack.header(t_ns);
            for cell in 0..2 {
                pack.number(&[1]);
                let voltage = 4.0 - f64::from(i) * 1e-4 - f64::from(cell);
                pack.number(&(voltage as f32).to_le_bytes());
            }
            sent.extend([
                ("/cmd_vel", twist),
                ("/pack", pack),
                ("/secret", Cdr::default()),
            ]);
        }
        for (topic, content) in sent {
            let header = MessageHeader {
                channel_id: channels[topic],
                sequence: i,
                log_time: t_ns,
                publish_time: t_ns,
            };
            writer
                .write_to_known_channel(&header, &content.message())
                .unwrap();
        }
    }
    writer.finish().unwrap();
}

/// Imports a log by its suggestion as it stands.
fn imported(suggestion: &Suggestion) -> (ImportedLog, Description) {
    let log: LogDescription = toml::from_str(&suggestion.log).unwrap();
    let robot: Description = toml::from_str(&suggestion.robot).unwrap();
    let imported = import(&log, &robot, &suggestion.folder).unwrap();
    (imported, robot)
}

fn column<'a>(log: &'a ImportedLog, name: &str) -> impl Iterator<Item = (f64, f64)> + 'a {
    let at = log
        .columns
        .iter()
        .position(|column| column == name)
        .unwrap();
    log.runs[0]
        .rows
        .iter()
        .map(move |row| (row[0], row[1 + at]))
}

#[test]
fn of_a_recording_radius_distance_and_signs_are_found() {
    let folder = TempDir::new().unwrap();
    let path = folder.path().join("drive.mcap");
    bag(&path);
    let suggestion = suggest(&path, "mine", "mine-robot.toml").unwrap();
    let (log, robot) = imported(&suggestion);
    assert!(
        (robot.wheel_radius_m - RADIUS_M).abs() < 0.02 * RADIUS_M,
        "{robot:?}"
    );
    assert!(
        (robot.wheels[0].y - TRACK_M / 2.0).abs() < 0.02,
        "{robot:?}"
    );
    for (name, side) in [("enc_L", 1.0), ("enc_R", -1.0)] {
        for (t_s, rate) in column(&log, name) {
            assert!(
                (rate - wheel(t_s, side)).abs() < 0.1,
                "{name} {t_s}: {rate}"
            );
        }
    }
    // A type that only the recording defines: its cells are channels.
    for (t_s, voltage) in column(&log, "cells_1_voltage").skip(2) {
        let sent = 4.0 - t_s / 0.02 * 1e-4 - 1.0;
        assert!((voltage - sent).abs() < 3e-4, "{t_s}: {voltage}");
    }
    assert!(
        suggestion
            .unsure
            .iter()
            .any(|line| line.contains("enc_R counts backwards"))
    );
    let found = agreements(&log, &robot);
    assert_eq!(found.len(), 4, "gyro, wheels and command, speed: {found:?}");
    assert!(
        found.iter().all(|agreement| agreement.doubt().is_none()),
        "{found:?}"
    );
}

#[test]
fn a_survey_lists_topics_columns_and_what_is_not_read() {
    let folder = TempDir::new().unwrap();
    let path = folder.path().join("drive.mcap");
    bag(&path);
    let survey = survey(&path).unwrap();
    let table = |name: &str| {
        survey
            .tables
            .iter()
            .find(|table| table.name == name)
            .unwrap()
    };
    assert_eq!(table("/joint_states").rows, 3000);
    assert!((table("/joint_states").rate_hz().unwrap() - 50.0).abs() < 0.01);
    let names: Vec<&str> = table("/pack")
        .columns
        .iter()
        .map(|c| c.name.as_str())
        .collect();
    let wanted = [
        "log_time",
        "header.stamp",
        "cells[0].is_on",
        "cells[0].voltage",
        "cells[1].is_on",
        "cells[1].voltage",
    ];
    assert_eq!(names, wanted);
    assert!(
        table("/joint_states")
            .columns
            .iter()
            .any(|c| c.name == "velocity[rl]")
    );
    let problem = table("/secret").problem.as_deref().unwrap();
    assert!(problem.contains("does not define this type"), "{problem}");
}

/// Runs of counters that wrap around, in CSV: the left one counts backwards.
fn tables(folder: &Path) {
    for run in 0..2 {
        let (mut base, mut gyro) = (
            "t_ms,ticksL,ticksR,v_cmd,omega_cmd\n".to_owned(),
            String::new(),
        );
        gyro.push_str("time;gyro_z\ns;deg/s\nt;gyro_z\n");
        let (mut left, mut right) = (0.0, 100.0);
        for i in 0..2000_u32 {
            let t_s = f64::from(i) * 0.02;
            // 400 steps a turn.
            let steps = |side| wheel(t_s, side) * 0.02 * 400.0 / std::f64::consts::TAU;
            left -= steps(1.0);
            right += steps(-1.0);
            let count = |value: f64| (value.floor() as i64).rem_euclid(1024);
            let (v, w) = drive(t_s);
            let (left, right) = (count(left), count(right));
            writeln!(base, "{},{left},{right},{v},{w}", i * 20).unwrap();
            writeln!(gyro, "{t_s};{}", w.to_degrees()).unwrap();
        }
        fs::write(folder.join(format!("base_{run}.csv")), base).unwrap();
        fs::write(folder.join(format!("gyro_{run}.csv")), gyro).unwrap();
    }
}

#[test]
fn of_tables_counters_degrees_and_files_that_belong_together_are_found() {
    let folder = TempDir::new().unwrap();
    tables(folder.path());
    let suggestion = suggest(folder.path(), "mine", "mine-robot.toml").unwrap();
    let (log, robot) = imported(&suggestion);
    assert!(
        robot.measured.wheel_rates && robot.measured.yaw_rate,
        "{}",
        suggestion.robot
    );
    assert_eq!(log.runs.len(), 2, "{}", suggestion.log);
    // Radius and steps only show together: the rim's speed is what counts.
    for (name, side) in [("enc_L", 1.0), ("enc_R", -1.0)] {
        let error =
            |(t_s, rate): (f64, f64)| rate * robot.wheel_radius_m - wheel(t_s, side) * RADIUS_M;
        let errors: Vec<f64> = column(&log, name).map(error).collect();
        let mean = errors.iter().map(|error| error.abs()).sum::<f64>() / errors.len() as f64;
        // A step in 20 ms is 0.06 m/s.
        assert!(mean < 0.04, "{name}: {mean}\n{}", suggestion.log);
    }
    for (t_s, rate) in column(&log, "yaw_rate") {
        assert!((rate - drive(t_s).1).abs() < 0.02, "{t_s}: {rate}");
    }
    let found = agreements(&log, &robot);
    assert!(
        found.iter().all(|agreement| agreement.doubt().is_none()),
        "{found:?}"
    );
}

#[test]
fn wrong_units_and_signs_are_told_by_channels_that_measure_the_same() {
    let folder = TempDir::new().unwrap();
    let path = folder.path().join("drive.mcap");
    bag(&path);
    let suggestion = suggest(&path, "mine", "mine-robot.toml").unwrap();
    let (right, robot) = imported(&suggestion);
    let spoilt = |name: &str, factor: f64| {
        let mut log = right.clone();
        let at = log
            .columns
            .iter()
            .position(|column| column == name)
            .unwrap();
        for row in log.runs.iter_mut().flat_map(|run| &mut run.rows) {
            row[1 + at] *= factor;
        }
        let found = agreements(&log, &robot);
        let doubts: Vec<String> = found.iter().filter_map(|found| found.doubt()).collect();
        doubts.join("\n")
    };
    assert_eq!(spoilt("yaw_rate", 1.0), "");
    let degrees = spoilt("yaw_rate", 57.2958);
    assert!(degrees.contains("is yaw_rate in degrees?"), "{degrees}");
    let sign = spoilt("yaw_rate", -1.0);
    assert!(
        sign.contains("is a sign wrong, or are sides exchanged?"),
        "{sign}"
    );
    let command = spoilt("cmd_speed", 1000.0);
    assert!(
        command.contains("is the commanded speed in mm?"),
        "{command}"
    );
    let too_fast = spoilt("cmd_speed", 2.5);
    assert!(
        too_fast.contains("the wheels' radius or distance wrong?"),
        "{too_fast}"
    );
}
