//! A healthy robot of whose frames some are lost, and whose pose begins anew.

use rand::{RngExt, SeedableRng};
use rand_distr::StandardNormal;
use rand_pcg::Pcg64Mcg;
use vigil_blocks::SensorFrame;
use vigil_robot::learned::channels::Channels;
use vigil_robot::learned::further_watch::Turn;
use vigil_robot::learned::monitor::Monitor;
use vigil_robot::learned::{Form, Observation, Observer};

use crate::learned::{circle, model, observe, robot};

const RATE_HZ: f64 = 100.0;
/// Steps of the integration in a frame.
const STEPS: usize = 10;

#[test]
fn travel_is_as_long_as_the_time_from_middle_to_middle() {
    let mut rng = Pcg64Mcg::seed_from_u64(5);
    let mut frames = circle(50.0, 60.0);
    frames.retain(|_| rng.random::<f64>() > 0.3);
    let observations = observe(&frames);
    let model = model();
    for observation in observations.iter().skip(1) {
        let speed = observation.travel_m / observation.middles_s;
        assert!((speed - 0.2).abs() < 1e-6, "{observation:?}");
        let turn = Turn::expected(&model, observation, |step| 0.5 * step.travel_m).unwrap();
        assert!((turn.rate_rad_s - 0.1).abs() < 1e-6 && turn.variance < 1e-12);
    }
    let uneven = |o: &&Observation| (o.middles_s - o.dt_s).abs() > 0.005;
    assert!(observations.iter().filter(uneven).count() > 100);
}

#[test]
fn no_frame_before_a_gap_is_averaged_with_one_after_it() {
    let mut frames = circle(RATE_HZ, 4.0);
    // Two frames into an observation.
    let [from, to] = [202, 292].map(|k| frames[k].header.t_capture_ns);
    frames.retain(|frame| !(from..to).contains(&frame.header.t_capture_ns));
    let after = observe(&frames);
    let after = after.iter().find(|o| o.t_ns >= to).unwrap();
    assert!(after.t_first_ns >= to && !after.anchor, "{after:?}");
    // The whole way is known all the same.
    let before_ns = after.t_first_ns as f64 - after.middles_s * 1e9;
    assert!(before_ns < from as f64);
}

#[test]
fn a_gyro_after_a_gap_may_read_how_the_robot_turns_by_now() {
    let [from_s, to_s] = [20.02, 20.95];
    let frames = drive(20.9, [from_s, to_s], 1);
    let after = observe(&frames);
    let after = after.iter().find(|o| o.covered() < 0.5).unwrap();
    let turn = Turn::expected(&model(), after, |step| step.per_metre[0] * step.travel_m).unwrap();
    // From 0.08 rad/s to -0.15 at the end of the gap.
    let read_rad_s = -0.5 * 0.3;
    assert!((turn.rate_rad_s - read_rad_s).abs() < 2.0 * turn.variance.sqrt());
}

/// A drive at 100 Hz whose command changes at `change_s`, on the model's own ground, the body
/// lagging by what the model believes; frames from `gap_s` on are lost for a while.
fn drive(change_s: f64, gap_s: [f64; 2], seed: u64) -> Vec<SensorFrame> {
    let model = model();
    let mut rng = Pcg64Mcg::seed_from_u64(seed);
    let [position, yaw] = [model.noise.position_m, model.noise.yaw_rad]
        .map(|sd| model.sample_variance(sd, 1.0 / RATE_HZ).sqrt());
    let (mut pose, mut body) = ([0.0_f64; 3], [0.4 * 0.2, 0.2]);
    let mut frames = Vec::new();
    for k in 0..(30.0 * RATE_HZ) as u64 {
        let t_s = k as f64 / RATE_HZ;
        let [curvature, speed] = if t_s < change_s {
            [0.4, 0.2]
        } else {
            [-0.5, 0.3]
        };
        let dt_s = 1.0 / RATE_HZ / STEPS as f64;
        for _ in 0..STEPS {
            let follows = dt_s / model.command.lag_s;
            body[0] += follows * (curvature * speed - body[0]);
            body[1] += follows * (speed - body[1]);
            let bend = body[0] / body[1];
            let limit = model.command.curvature_max_1_m;
            let motion = model.nominal.motion.per_metre(bend, body[1], limit);
            let [turn, forward, left] = motion.map(|per_metre| per_metre * body[1] * dt_s);
            let (sin, cos) = (pose[2] + 0.5 * turn).sin_cos();
            pose[0] += forward * cos - left * sin;
            pose[1] += forward * sin + left * cos;
            pose[2] += turn;
        }
        let mut noise = |sd: f64| sd * rng.sample::<f64, _>(StandardNormal);
        let mut frame = SensorFrame {
            run_id: 1,
            ..SensorFrame::default()
        };
        frame.header.t_capture_ns = 1_000_000_000 + (t_s * 1e9).round() as u64;
        frame.set_command(0, curvature);
        frame.set_command(1, speed);
        let sd = [position, position, yaw];
        for i in 0..3 {
            frame.set_channel(i, pose[i] + noise(sd[i]));
        }
        if !(gap_s[0]..gap_s[1]).contains(&t_s) {
            frames.push(frame);
        }
    }
    frames
}

/// The highest log-odds of a fault in the last ten seconds of a drive.
fn log_odds_max(frames: &[SensorFrame]) -> f64 {
    let (model, robot) = (model(), robot());
    let mut observer = Observer::new(&model, &robot);
    let mut monitor = Monitor::new(&model, &robot, Channels::Pose, Form::LearnedBias, 1.0);
    let from_ns = frames.last().unwrap().header.t_capture_ns - 10_000_000_000;
    let mut most = f64::NEG_INFINITY;
    for frame in frames {
        if observer.push(frame).complete {
            monitor.step(observer.observation(), None, false);
        }
        if frame.header.t_capture_ns > from_ns {
            most = most.max(monitor.report().log_odds);
        }
    }
    assert!(most.is_finite());
    most
}

#[test]
fn a_command_that_changes_in_a_gap_is_no_fault() {
    for seed in 0..40 {
        let gap_s = [20.02, 20.95];
        let change_s = gap_s[0] + 0.93 * seed as f64 / 40.0;
        let log_odds = log_odds_max(&drive(change_s, gap_s, seed));
        assert!(log_odds < 0.0, "{change_s} s: {log_odds}");
    }
}

#[test]
fn an_outlier_among_the_first_poses_after_a_gap_is_no_fault() {
    for (seed, deviations) in [(1, 8.0), (2, -12.0), (3, 20.0), (4, -30.0)] {
        for which in 0..6 {
            let mut frames = drive(5.0, [20.0, 22.0], seed);
            // At 20 Hz a frame is an observation.
            let mut k = 0;
            frames.retain(|_| {
                k += 1;
                k % 5 == 1
            });
            let first = frames
                .iter()
                .position(|f| f.header.t_capture_ns >= 23_000_000_000);
            let frame = &mut frames[first.unwrap() + which];
            frame.channel[1] += deviations * model().noise.position_m * 5.0_f64.sqrt();
            let log_odds = log_odds_max(&frames);
            assert!(log_odds < 0.0, "pose {which} by {deviations}: {log_odds}");
        }
    }
}
