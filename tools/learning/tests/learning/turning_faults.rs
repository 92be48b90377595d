//! Declared faults that come back with the turns of a wheel.

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

use super::small::small;

const RATE_HZ: f64 = 50.0;
/// Deviation of the noise: of a wheel's rate, rad/s, and of a current, A.
const NOISE: [f64; 2] = [0.1, 0.02];
/// When a tyre is flat whose alarm is checked, s.
const ONSET_S: f64 = 40.0;

/// How a wheel drives.
type Drive = fn(u64) -> [f64; 2];

/// Both ways round, at many speeds.
fn curves(step: u64) -> [f64; 2] {
    let at = |of: u64| (step * of % 11) as f64 / 10.0;
    match step % 8 {
        7 => [0.0, 0.0],
        _ => [0.3 + 0.4 * at(3), 0.8 * at(7) - 0.4],
    }
}

/// Forward and back again.
fn there_and_back(step: u64) -> [f64; 2] {
    let [v, w] = curves(step);
    let sense = if step % 4 < 2 { 1.0 } else { -1.0 };
    [sense * v, w]
}

/// Straight on: the wheels turn alike.
fn straight(step: u64) -> [f64; 2] {
    [curves(step)[0], 0.0]
}

fn robot() -> Description {
    small(
        "measured = { pose = false, wheel_rates = true, steer = false, currents = true }\n\
         polynomial_order = 1\n\
         fault = [{ name = 'LEFT', wheel = 'L' }, { name = 'RIGHT', wheel = 'R' }]",
    )
}

/// A run in which the tyres are flat from `onset_s` on: by so much of the noise.
fn run(id: u32, length_s: f64, flat: [f64; 2], onset_s: f64) -> Run {
    driven(id, length_s, (flat, onset_s), curves)
}

fn driven(id: u32, length_s: f64, (flat, onset_s): ([f64; 2], f64), drive: Drive) -> Run {
    let mut rng = Pcg64Mcg::seed_from_u64(u64::from(id));
    let mut angles = [0.0, 0.0].map(|_: f64| rng.random_range(0.0..6.0));
    let mut frames = Vec::new();
    for i in 0..(length_s * RATE_HZ) as u64 {
        let t_s = i as f64 / RATE_HZ;
        let [v, w] = drive((t_s / 4.0) as u64);
        let mut frame = SensorFrame::default();
        frame.header.t_capture_ns = (t_s * 1e9) as u64;
        (frame.header.seq, frame.run_id) = (i, u64::from(id) + 1);
        frame.set_command(0, v);
        frame.set_command(1, w);
        let angles_before = angles;
        for wheel in 0..2 {
            let side = [0.1, -0.1][wheel];
            let told = (v - side * w) / 0.1;
            let size = if t_s >= onset_s { flat[wheel] } else { 0.0 };
            let angle: f64 = angles[wheel];
            let noise = NOISE.map(|sd| sd * rng.sample::<f64, _>(StandardNormal));
            let shakes = size * NOISE[0] * ((2.0 * angle).cos() + 0.5 * (angle + 1.0).sin());
            // Both drives are on one supply.
            let draws = [0, 1].map(|i| {
                let size = if t_s >= onset_s { flat[i] } else { 0.0 };
                size * NOISE[1] * f64::cos(angles_before[i] - 0.5)
            });
            let draws = draws[wheel] + 0.8 * draws[1 - wheel];
            let turns = f64::from(told != 0.0);
            // On the way back a rate is shaken in the other sense, a current is not.
            let rate = told + turns * told.signum() * shakes;
            angles[wheel] += rate / RATE_HZ;
            frame.set_channel(wheel, rate + noise[0]);
            frame.set_channel(2 + wheel, 0.3 + turns * draws + noise[1]);
        }
        frames.push(frame);
    }
    Run { id, frames }
}

/// A model of ten healthy minutes and of these runs, all flat from their beginning.
fn learned(robot: &Description, flat: &[(Run, &str)]) -> (Model, Report) {
    learned_from(robot, &run(0, 600.0, [0.0; 2], 0.0), flat)
}

fn learned_from(robot: &Description, healthy: &Run, flat: &[(Run, &str)]) -> (Model, Report) {
    let label = |(run, fault): &'_ (Run, &'_ str)| (run.clone(), (*fault).to_owned());
    let owned: Vec<(Run, String)> = flat.iter().map(label).collect();
    let labelled: Vec<LabelledRun<'_>> = owned
        .iter()
        .map(|(run, fault)| LabelledRun {
            run,
            fault,
            onset_s: 0.0,
        })
        .collect();
    let log = Log {
        labelled: &labelled,
        ..Log::of_healthy(std::slice::from_ref(healthy))
    };
    learn(&log, robot).unwrap()
}

fn usual_runs() -> Vec<(Run, &'static str)> {
    let left = (1..4).map(|id| (run(id, 60.0, [1.0, 0.0], 0.0), "LEFT"));
    let right = (4..7).map(|id| (run(id, 60.0, [0.0, 1.0], 0.0), "RIGHT"));
    left.chain(right).collect()
}

/// First alarm of 24 h between false ones, s, and what was believed at the end: the probability of
/// each of the two, and that of both.
fn found(model: &Model, robot: &Description, run: &Run) -> (Option<f64>, [f64; 2], f64) {
    let calibration = model.calibration(Channels::PoseEncoders, Form::LearnedBias);
    let threshold = calibration.unwrap().alarm_log_odds(24.0, 1.0);
    let mut monitor = Monitor::new(model, robot, Channels::PoseEncoders, 1.0).unwrap();
    let mut observer = Observer::new(robot);
    let mut alarm_s = None;
    for frame in &run.frames {
        if observer.push(frame).complete {
            monitor.step(observer.history(), observer.orders());
            if monitor.is_ready() && monitor.report().log_odds > threshold {
                alarm_s = alarm_s.or(Some(frame.header.t_capture_ns as f64 * 1e-9));
            }
        }
    }
    let parts = components(robot);
    let p = |name: &str| {
        let place = parts.iter().position(|part| part.name == name).unwrap();
        monitor.beliefs()[place].p
    };
    let both = monitor.pair().map_or(0.0, |pair| pair.p);
    (alarm_s, [p("LEFT"), p("RIGHT")], both)
}

/// Checks that the alarm comes within half a minute of the onset.
#[track_caller]
fn check_alarm(alarm_s: Option<f64>) {
    let is_soon = alarm_s.is_some_and(|t_s| (ONSET_S..ONSET_S + 30.0).contains(&t_s));
    assert!(is_soon, "{alarm_s:?}");
}

#[test]
fn a_flat_tyre_is_named_by_its_wheel_and_two_are_named_together() {
    let robot = robot();
    let (model, report) = learned(&robot, &usual_runs());
    let fits: Vec<_> = report
        .faults
        .iter()
        .map(|fit| (fit.runs_found, fit.parts))
        .collect();
    assert_eq!(fits, [(3, 3), (3, 3)]);
    assert_eq!(Model::from_toml(&model.to_toml().unwrap()).unwrap(), model);
    let of = |flat| found(&model, &robot, &run(50, 120.0, flat, ONSET_S));
    let (alarm_s, [left, right], both) = of([1.0, 0.0]);
    check_alarm(alarm_s);
    assert!(left > 0.9, "{left} {right} {both}");
    let (alarm_s, [left, right], both) = of([0.0, 0.8]);
    check_alarm(alarm_s);
    assert!(right > 0.9, "{left} {right} {both}");
    let (alarm_s, [left, right], both) = of([1.0, 1.0]);
    check_alarm(alarm_s);
    assert!(both > 0.9, "{left} {right} {both}");
}

#[test]
fn healthy_wheels_raise_no_alarm() {
    let robot = robot();
    let (model, _) = learned(&robot, &usual_runs());
    for id in 20..23 {
        let (alarm_s, ..) = found(&model, &robot, &run(id, 600.0, [0.0; 2], 0.0));
        assert_eq!(alarm_s, None, "{id}");
    }
}

#[test]
fn a_single_run_is_cut_into_thirds_and_the_report_says_so() {
    let robot = robot();
    let flat = [(run(1, 120.0, [1.0, 0.0], 0.0), "LEFT")];
    let (model, report) = learned(&robot, &flat);
    let fit = &report.faults[0];
    assert_eq!((fit.groups, fit.parts, fit.runs_found), (1, 3, 3));
    assert!(fit.is_used && model.turning.fault.len() == 1);
    let said = fit.to_string();
    assert!(
        said.contains("3 of 3 parts") && said.contains("of that day"),
        "{said}"
    );
}

#[test]
fn runs_that_show_nothing_teach_nothing() {
    let robot = robot();
    let healthy = (1..4).map(|id| (run(id, 60.0, [0.0; 2], 0.0), "LEFT"));
    let (model, report) = learned(&robot, &healthy.collect::<Vec<_>>());
    assert!(!report.faults[0].is_used, "{}", report.faults[0]);
    assert!(model.turning.is_empty());
    // A run that stands has no turns.
    let mut stands = run(9, 60.0, [1.0, 0.0], 0.0);
    for frame in &mut stands.frames {
        frame.set_command(0, 0.0);
        frame.set_command(1, 0.0);
        frame.set_channel(0, 0.0);
        frame.set_channel(1, 0.0);
    }
    let (_, report) = learned(&robot, &[(stands, "LEFT")]);
    assert!(
        report.faults[0]
            .to_string()
            .contains("no run shows turns of L")
    );
}

#[test]
fn a_robot_that_often_turns_back_is_helped_as_well() {
    let robot = robot();
    let (model, _) = learned(&robot, &usual_runs());
    let of = |flat| {
        found(
            &model,
            &robot,
            &driven(60, 120.0, (flat, ONSET_S), there_and_back),
        )
    };
    let (alarm_s, [left, right], both) = of([1.0, 0.0]);
    check_alarm(alarm_s);
    assert!(left > 0.9, "{left} {right} {both}");
}

#[test]
fn one_tyre_alone_is_named_while_the_wheels_turn_alike() {
    let robot = robot();
    let (model, _) = learned(&robot, &usual_runs());
    for size in [1.0, 3.0] {
        let flat = driven(61, 120.0, ([size, 0.0], 40.0), straight);
        let (_, [left, right], both) = found(&model, &robot, &flat);
        assert!(left > 0.9, "{size}: {left} {right} {both}");
    }
}

#[test]
fn evidence_outlasts_a_gap_of_the_record() {
    let robot = robot();
    let (model, _) = learned(&robot, &usual_runs());
    let cut = with_gaps(run(62, 122.0, [1.0, 0.0], 40.0), |t_s| {
        (117.0..119.0).contains(&t_s)
    });
    let (_, [left, right], both) = found(&model, &robot, &cut);
    assert!(left > 0.9, "{left} {right} {both}");
}

#[test]
fn wheels_that_were_never_round_raise_no_alarm_and_flat_ones_still_do() {
    let robot = robot();
    let usual = 0.3;
    let healthy = run(0, 600.0, [usual; 2], 0.0);
    let flat = (1..4).map(|id| (run(id, 60.0, [1.0 + usual, usual], 0.0), "LEFT"));
    let (model, report) = learned_from(&robot, &healthy, &flat.collect::<Vec<_>>());
    assert!(report.faults[0].is_used, "{}", report.faults[0]);
    for id in 70..72 {
        let (alarm_s, ..) = found(&model, &robot, &run(id, 600.0, [usual; 2], 0.0));
        assert_eq!(alarm_s, None, "{id}");
    }
    let (_, [left, _], _) = found(&model, &robot, &run(72, 120.0, [1.0 + usual, usual], 0.0));
    assert!(left > 0.9, "{left}");
}

fn with_gaps(mut run: Run, is_lost: impl Fn(f64) -> bool) -> Run {
    let is_kept = |frame: &SensorFrame| !is_lost(frame.header.t_capture_ns as f64 * 1e-9);
    run.frames.retain(is_kept);
    run
}

#[test]
fn runs_with_gaps_teach_as_much_as_runs_without() {
    let robot = robot();
    // After a gap nobody knows how the wheel stands.
    let cut = |(run, fault)| (with_gaps(run, |t_s| t_s % 16.0 > 15.0), fault);
    let flat: Vec<_> = usual_runs().into_iter().map(cut).collect();
    let (with_gaps, report) = learned(&robot, &flat);
    assert!(
        report.faults.iter().all(|fit| fit.is_used),
        "{:?}",
        report.faults
    );
    let (without, _) = learned(&robot, &usual_runs());
    let size = |model: &Model| {
        let one = &model.turning.fault[0];
        let all = one.real.iter().chain(&one.imaginary);
        all.map(|value| value * value).sum::<f64>()
    };
    let ratio = size(&with_gaps) / size(&without);
    assert!((0.6..1.4).contains(&ratio), "{ratio}");
}
