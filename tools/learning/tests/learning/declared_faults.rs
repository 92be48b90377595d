//! Faults that a description declares: named by the channels that they shift, or by labelled runs.

use rand::{RngExt, SeedableRng};
use rand_distr::StandardNormal;
use rand_pcg::Pcg64Mcg;
use vigil_blocks::SensorFrame;
use vigil_learning::channel_learning::{LabelledRun, Log, Report, learn};
use vigil_recording::frames::Run;
use vigil_robot::Description;
use vigil_robot::channel_model::{Model, Monitor, Observer, components};
use vigil_robot::learned::Form;
use vigil_robot::learned::channels::Channels;

const NOISE: f64 = 0.05;
const RATE_HZ: f64 = 50.0;
const ONSET_S: f64 = 40.0;
const CHANNELS: usize = 4;

/// An aircraft without a command: four channels.
fn robot(warm_up_s: f64) -> Description {
    toml::from_str(&format!(
        r#"
name = "kite"
kinematics = "none"
command = []
warm_up_s = {warm_up_s:.1}
[measured]
pose = false
wheel_rates = false
steer = false

[[channel]]
name = "a"

[[channel]]
name = "b"

[[channel]]
name = "c"

[[channel]]
name = "d"

[[fault]]
name = "engine"

[[fault]]
name = "rudder"
group = "SURFACE"
shows = ["a", "b"]

[[fault]]
name = "flap"
group = "SURFACE"
shows = ["c", "d"]
"#
    ))
    .unwrap()
}

/// What each channel reads more from the onset on, as a function of the fault's age, s.
type Effect = fn(f64) -> [f64; CHANNELS];

const NOTHING: Effect = |_| [0.0; CHANNELS];
/// It grows over a second, and the robot answers in another channel.
const ENGINE: Effect = |age_s| {
    let grown = age_s.min(1.0);
    let answered = (0.5 * (age_s - 1.0)).clamp(0.0, 1.0);
    [-0.08 * grown, 0.0, 0.06 * grown, 0.08 * answered]
};

fn run(id: u32, length_s: f64, scale: f64, effect: Effect) -> Run {
    let mut rng = Pcg64Mcg::seed_from_u64(u64::from(id));
    let frame = |i: u64| {
        let t_s = i as f64 / RATE_HZ;
        let mut frame = SensorFrame::default();
        frame.header.t_capture_ns = (t_s * 1e9) as u64;
        (frame.header.seq, frame.run_id) = (i, u64::from(id) + 1);
        let more = match t_s >= ONSET_S {
            true => effect(t_s - ONSET_S),
            false => [0.0; CHANNELS],
        };
        for (channel, more) in more.into_iter().enumerate() {
            let noise = NOISE * rng.sample::<f64, _>(StandardNormal);
            frame.set_channel(channel, 1.0 + noise + scale * more);
        }
        frame
    };
    let frames = (0..(length_s * RATE_HZ) as u64).map(frame).collect();
    Run { id, frames }
}

/// A model of ten minutes without a fault, and of runs in which the engine fails, each of a group.
fn learned(robot: &Description, failed: &[Run], groups: &[&str]) -> (Model, Report) {
    learned_from(robot, failed, groups, ONSET_S)
}

/// The same of runs that are labelled with another onset.
fn learned_from(
    robot: &Description,
    failed: &[Run],
    groups: &[&str],
    onset_s: f64,
) -> (Model, Report) {
    let healthy = [run(0, 700.0, 0.0, NOTHING)];
    let label = |run| LabelledRun {
        run,
        fault: "engine",
        onset_s,
    };
    let labelled: Vec<LabelledRun<'_>> = failed.iter().map(label).collect();
    let groups = failed.iter().zip(groups);
    let groups: Vec<(u32, String)> = groups
        .map(|(run, &group)| (run.id, group.to_owned()))
        .collect();
    let log = Log {
        labelled: &labelled,
        groups: &groups,
        ..Log::of_healthy(&healthy)
    };
    learn(&log, robot).unwrap()
}

/// First alarm of 24 h between false ones, s, and the most probable component two seconds later.
fn found(model: &Model, robot: &Description, run: &Run) -> Option<(f64, String)> {
    let calibration = model.calibration(Channels::PoseEncoders, Form::LearnedBias);
    let threshold = calibration.unwrap().alarm_log_odds(24.0, 1.0);
    let mut monitor = Monitor::new(model, robot, Channels::PoseEncoders, 1.0).unwrap();
    let mut observer = Observer::new(robot);
    let mut alarm_s = None;
    for frame in &run.frames {
        if !observer.push(frame).complete {
            continue;
        }
        monitor.step(observer.history(), observer.orders());
        let t_s = frame.header.t_capture_ns as f64 * 1e-9;
        if monitor.is_ready() && monitor.report().log_odds > threshold {
            alarm_s = alarm_s.or(Some(t_s));
        }
        if alarm_s.is_some_and(|alarm_s| t_s >= alarm_s + 2.0) {
            let parts = components(robot);
            let beliefs = monitor.beliefs().iter().zip(&parts);
            let best = beliefs.max_by(|a, b| a.0.p.total_cmp(&b.0.p)).unwrap();
            return Some((alarm_s?, best.1.name.clone()));
        }
    }
    None
}

#[test]
fn a_fault_of_labelled_runs_is_named_in_a_run_that_was_not_learned_from() {
    let robot = robot(0.0);
    let runs: Vec<Run> = (1..7)
        .map(|id| run(id, 60.0, 0.7 + 0.1 * f64::from(id), ENGINE))
        .collect();
    let groups = ["monday", "monday", "tuesday", "tuesday", "friday", "friday"];
    let (model, report) = learned(&robot, &runs, &groups);
    assert_eq!(report.faults.len(), 1);
    let fit = &report.faults[0];
    assert_eq!(
        (fit.fault.as_str(), fit.runs_with_onset, fit.runs_found),
        ("engine", 6, 6)
    );
    assert!(fit.is_used);
    let text = model.to_toml().unwrap();
    assert_eq!(Model::from_toml(&text).unwrap(), model);
    let (alarm_s, name) = found(&model, &robot, &run(9, 60.0, 0.9, ENGINE)).unwrap();
    assert!((ONSET_S..ONSET_S + 4.0).contains(&alarm_s), "{alarm_s}");
    assert_eq!(name, "engine");
    for id in 20..24 {
        assert_eq!(found(&model, &robot, &run(id, 120.0, 0.0, NOTHING)), None);
    }
}

#[test]
fn runs_of_one_group_alone_vouch_for_nothing() {
    let runs: Vec<Run> = (1..4).map(|id| run(id, 60.0, 1.0, ENGINE)).collect();
    let (model, report) = learned(&robot(0.0), &runs, &["monday"; 3]);
    let fit = &report.faults[0];
    assert_eq!((fit.runs, fit.groups, fit.is_used), (3, 1, false));
    assert!(fit.to_string().contains("one group"), "{fit}");
    assert!(model.signatures.is_empty());
}

#[test]
fn runs_that_are_faulty_from_the_beginning_teach_nothing() {
    let runs: Vec<Run> = (1..5).map(|id| run(id, 60.0, 1.0, ENGINE)).collect();
    let groups = ["monday", "tuesday", "friday", "sunday"];
    let (model, report) = learned_from(&robot(0.0), &runs, &groups, 0.0);
    let fit = &report.faults[0];
    assert_eq!((fit.runs, fit.runs_with_onset, fit.is_used), (4, 0, false));
    assert!(model.signatures.is_empty());
}

/// Probability that something is wrong, in the median of a healthy run.
fn usual_p_fault(model: &Model, robot: &Description) -> f64 {
    let mut monitor = Monitor::new(model, robot, Channels::PoseEncoders, 1.0).unwrap();
    let mut observer = Observer::new(robot);
    let mut found = Vec::new();
    for frame in &run(90, 200.0, 0.0, NOTHING).frames {
        if observer.push(frame).complete {
            monitor.step(observer.history(), observer.orders());
            found.push(1.0 / (1.0 + (-monitor.report().log_odds).exp()));
        }
    }
    found.sort_by(f64::total_cmp);
    found[found.len() / 2]
}

#[test]
fn a_signature_leaves_a_healthy_robot_in_peace() {
    let robot = robot(0.0);
    let (without, _) = learned(&robot, &[], &[]);
    let usual = usual_p_fault(&without, &robot);
    for scale in [0.2, 0.35, 0.6, 1.0, 2.0] {
        let runs: Vec<Run> = (1..5).map(|id| run(id, 60.0, scale, ENGINE)).collect();
        let groups = ["monday", "tuesday", "friday", "sunday"];
        let (model, _) = learned(&robot, &runs, &groups);
        let found = usual_p_fault(&model, &robot);
        assert!(
            found < 2.0 * usual + 0.01,
            "{scale}: {found}, without {usual}"
        );
    }
}

#[test]
fn a_model_is_of_the_faults_that_were_declared_when_it_was_learned() {
    let robot = robot(0.0);
    let (model, _) = learned(&robot, &[], &[]);
    model.check_robot(&robot).unwrap();
    let mut other = robot.clone();
    other.fault[1].shows.pop();
    let refused = model.check_robot(&other).unwrap_err().to_string();
    assert!(refused.contains("rudder (shows in a b)"), "{refused}");
    let mut other = robot.clone();
    other.warm_up_s = 3.0;
    assert!(model.check_robot(&other).is_err());
    let mut other = robot;
    other.channel[2].period = Some(360.0);
    assert!(model.check_robot(&other).is_err());
}

#[test]
fn a_declared_fault_is_named_by_its_channels_and_a_sensor_by_its_own() {
    let robot = robot(0.0);
    let (model, report) = learned(&robot, &[], &[]);
    assert!(report.faults.is_empty());
    let cases: [(Effect, &str); 4] = [
        (|_| [0.08, 0.06, 0.0, 0.0], "rudder"),
        (|_| [0.08, -0.06, 0.0, 0.0], "rudder"),
        (|_| [0.0, 0.0, -0.05, 0.09], "flap"),
        (|_| [0.0, 0.0, 0.1, 0.0], "c"),
    ];
    for (i, (effect, expected)) in cases.into_iter().enumerate() {
        let (alarm_s, name) =
            found(&model, &robot, &run(30 + i as u32, 60.0, 1.0, effect)).unwrap();
        assert!(
            (ONSET_S..ONSET_S + 4.0).contains(&alarm_s),
            "{expected}: {alarm_s}"
        );
        assert_eq!(name, expected);
    }
}

#[test]
fn a_warm_up_is_neither_learned_from_nor_watched() {
    let robot = robot(15.0);
    let cold = |id: u32, length_s: f64| {
        let mut run = run(id, length_s, 0.0, NOTHING);
        for frame in &mut run.frames {
            if frame.header.t_capture_ns < 14_000_000_000 {
                frame.set_channel(1, 0.0);
            }
        }
        run
    };
    let (model, _) = learn(&Log::of_healthy(&[cold(0, 700.0)]), &robot).unwrap();
    assert!((model.channel[1].variance[0].sqrt() - NOISE / 5_f64.sqrt()).abs() < 0.003);
    assert_eq!(found(&model, &robot, &cold(2, 60.0)), None);
    let without = Description {
        warm_up_s: 0.0,
        ..robot
    };
    assert!(found(&model, &without, &cold(2, 60.0)).is_some());
}

#[test]
fn an_angle_is_the_same_after_a_period() {
    let mut robot = robot(0.0);
    robot.channel[0].period = Some(360.0);
    let mut observer = Observer::new(&robot);
    let mut seen = Vec::new();
    // The first frame only says where the first observation begins; five make one.
    let read = [
        0.0, 1.0, -1.0, 2.0, 719.0, 361.0, 179.5, -179.5, 180.0, 181.0, -179.0,
    ];
    for (i, degrees) in read.into_iter().enumerate() {
        let mut frame = SensorFrame::default();
        frame.header.t_capture_ns = i as u64 * 20_000_000;
        (frame.header.seq, frame.run_id) = (i as u64, 1);
        frame.set_channel(0, degrees);
        if observer.push(&frame).complete {
            seen.push(observer.history().ago(0).unwrap().values[0].unwrap());
        }
    }
    let expected = [0.4, -179.6];
    assert_eq!(seen.len(), expected.len());
    for (seen, expected) in seen.into_iter().zip(expected) {
        assert!((seen - expected).abs() < 1e-9, "{seen} {expected}");
    }
}
