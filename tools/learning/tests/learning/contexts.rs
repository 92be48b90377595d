//! Changes that are no fault, as of the ground: learned from labelled runs, told without an alarm.

use rand::{RngExt, SeedableRng};
use rand_distr::StandardNormal;
use rand_pcg::Pcg64Mcg;
use vigil_blocks::SensorFrame;
use vigil_learning::channel_learning::{LabelledChange, Log, Report, learn};
use vigil_recording::frames::Run;
use vigil_robot::Description;
use vigil_robot::channel_model::{Model, Monitor, Observer};
use vigil_robot::learned::Form;
use vigil_robot::learned::channels::Channels;

const NOISE: f64 = 0.05;
const RATE_HZ: f64 = 50.0;
const ONSET_S: f64 = 12.0;
const LENGTH_S: f64 = 30.0;
const CHANNELS: usize = 4;
/// What the currents of three motors read more over the other ground; the fourth channel is none.
const DRAG: [f64; CHANNELS] = [0.030, 0.025, -0.020, 0.0];

fn robot() -> Description {
    let channel = |name: &str| format!("[[channel]]\nname = \"{name}\"\n");
    let channels: String = ["a", "b", "c", "d"].map(channel).concat();
    toml::from_str(&format!(
        "name = \"cart\"\nkinematics = \"none\"\ncommand = []\n\
         measured = {{ pose = false, wheel_rates = false, steer = false }}\n\
         {channels}[[context]]\nname = \"ground\"\n"
    ))
    .unwrap()
}

/// A run whose drag changes at the onset, by so much of that of the other ground: either sign, as a
/// robot may come from either side.
fn run(id: u32, length_s: f64, drag: f64) -> Run {
    let mut rng = Pcg64Mcg::seed_from_u64(u64::from(id));
    let frame = |i: u64| {
        let t_s = i as f64 / RATE_HZ;
        let mut frame = SensorFrame::default();
        frame.header.t_capture_ns = (t_s * 1e9) as u64;
        (frame.header.seq, frame.run_id) = (i, u64::from(id) + 1);
        let part = if t_s >= ONSET_S { drag } else { 0.0 };
        for (channel, more) in DRAG.into_iter().enumerate() {
            let noise = NOISE * rng.sample::<f64, _>(StandardNormal);
            frame.set_channel(channel, 1.0 + noise + part * more);
        }
        frame
    };
    let frames = (0..(length_s * RATE_HZ) as u64).map(frame).collect();
    Run { id, frames }
}

/// Twenty runs that cross, by turns from either side, in groups of four.
fn crossings() -> Vec<Run> {
    let sign = |id: u32| if id.is_multiple_of(2) { 1.0 } else { -1.0 };
    let of = |id: u32| run(id, LENGTH_S, sign(id) * (0.9 + 0.01 * f64::from(id)));
    (1..21).map(of).collect()
}

/// A model of ten minutes without a change, and of runs with one, all of which are healthy.
fn learned(crossings: &[Run], group: impl Fn(u32) -> String) -> (Model, Report) {
    let mut runs = vec![run(0, 600.0, 0.0)];
    runs.extend(crossings.iter().cloned());
    let label = |run: &Run| LabelledChange {
        run: run.id,
        context: "ground",
        onset_s: ONSET_S,
    };
    let changes: Vec<LabelledChange<'_>> = crossings.iter().map(label).collect();
    let groups = crossings.iter().map(|run| (run.id, group(run.id)));
    let groups: Vec<(u32, String)> = groups.collect();
    let log = Log {
        changes: &changes,
        groups: &groups,
        ..Log::of_healthy(&runs)
    };
    learn(&log, &robot()).unwrap()
}

/// When changes of a run came, s, by what is told of it, and whether an alarm rose.
fn told(model: &Model, run: &Run) -> (Vec<f64>, bool) {
    let robot = robot();
    let calibration = model.calibration(Channels::PoseEncoders, Form::LearnedBias);
    let threshold = calibration.unwrap().alarm_log_odds(24.0, 1.0);
    let mut monitor = Monitor::new(model, &robot, Channels::PoseEncoders, 1.0).unwrap();
    let mut observer = Observer::new(&robot);
    let (mut changes_s, mut alarms) = (Vec::new(), false);
    for frame in &run.frames {
        if !observer.push(frame).complete {
            continue;
        }
        let before = monitor.changes().count();
        monitor.step(observer.history(), observer.orders());
        alarms |= monitor.is_ready() && monitor.report().log_odds > threshold;
        if monitor.changes().count() != before {
            changes_s.push(monitor.changes().last().unwrap().t_ns as f64 * 1e-9);
        }
    }
    (changes_s, alarms)
}

#[test]
fn a_change_of_either_sign_is_told_once_and_raises_no_alarm() {
    let (model, report) = learned(&crossings(), |id| format!("{}", id % 5));
    let [fit] = &report.contexts[..] else {
        panic!("{:?}", report.contexts)
    };
    assert_eq!((fit.runs, fit.runs_with_step, fit.groups), (20, 20, 5));
    assert!(fit.is_used && fit.runs_told >= 18, "{fit}");
    let text = report.to_string();
    assert!(text.contains("ground: told by"), "{text}");
    // The whole of a run with a change is healthy.
    assert!(report.exposure_s > 590.0 + 20.0 * (LENGTH_S - 2.0));
    let text = model.to_toml().unwrap();
    assert_eq!(Model::from_toml(&text).unwrap(), model);
    model.check_robot(&robot()).unwrap();
    for (id, drag) in [(101, 1.0), (102, -1.0), (103, 1.2), (104, -1.2)] {
        let (changes_s, alarms) = told(&model, &run(id, LENGTH_S, drag));
        let [t_s] = changes_s[..] else {
            panic!("{drag}: {changes_s:?}")
        };
        assert!((t_s - ONSET_S).abs() <= 1.0, "{drag}: {t_s}");
        assert!(!alarms, "{drag}");
    }
    for id in 200..204 {
        let found = told(&model, &run(id, 120.0, 0.0));
        assert_eq!(found, (Vec::new(), false), "healthy run {id}");
    }
}

#[test]
fn runs_of_one_group_or_without_a_step_vouch_for_nothing() {
    let (model, report) = learned(&crossings(), |_| "monday".to_owned());
    let fit = &report.contexts[0];
    assert_eq!((fit.groups, fit.is_used), (1, false));
    assert!(fit.to_string().contains("one group"), "{fit}");
    assert!(model.contexts.is_empty());
    let none: Vec<Run> = (1..21).map(|id| run(id, LENGTH_S, 0.0)).collect();
    let (model, report) = learned(&none, |id| format!("{}", id % 5));
    let fit = &report.contexts[0];
    assert!(!fit.is_used && fit.runs_told < 5, "{fit}");
    assert!(model.contexts.is_empty());
}

#[test]
fn a_change_that_shows_in_other_channels_is_not_told() {
    let mut robot = robot();
    robot.context[0].shows = vec!["d".to_owned()];
    let runs: Vec<Run> = crossings();
    let label = |run: &Run| LabelledChange {
        run: run.id,
        context: "ground",
        onset_s: ONSET_S,
    };
    let changes: Vec<LabelledChange<'_>> = runs.iter().map(label).collect();
    let log = Log {
        changes: &changes,
        ..Log::of_healthy(&runs)
    };
    let (model, report) = learn(&log, &robot).unwrap();
    assert!(!report.contexts[0].is_used && model.contexts.is_empty());
}
