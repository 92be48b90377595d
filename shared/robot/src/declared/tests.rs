use std::sync::LazyLock;

use super::*;
use crate::learned::Reading;

const NULL: Null = Null {
    noise_ratio: 1.25,
    correlation: 0.1,
};
const PROMISE: Promise = Promise {
    interval_h: 24.0,
    fault_rate_1_h: 1.0,
};
const DT_S: f64 = 0.05;

static ROBOT: LazyLock<Description> =
    LazyLock::new(|| toml::from_str(include_str!("../../../../config/robots/rover.toml")).unwrap());

static MODEL: LazyLock<Model> = LazyLock::new(|| {
    Model::from_toml(include_str!("../../../../config/models/rover.toml")).unwrap()
});

fn monitor(channels: Channels) -> Monitor {
    Monitor::new(&MODEL, &ROBOT, channels, NULL, PROMISE).unwrap()
}

/// A steady drive straight ahead, read without noise; `change` makes it another one.
fn observation(k: u32, change: impl Fn(&mut Observation)) -> Observation {
    let (model, robot, speed) = (&*MODEL, &*ROBOT, 0.2);
    let limit = model.command.curvature_max_1_m;
    let [yaw, ahead, across] = model.nominal.motion.per_metre(0.0, speed, limit);
    let travel_m = speed * DT_S * f64::from(k);
    // The model's drift is that of a circle, of which this is a chord.
    let heading = yaw * travel_m;
    let (sin, cos) = (0.5 * heading).sin_cos();
    let mut observation = Observation {
        dt_s: DT_S,
        middles_s: DT_S,
        frame_s: DT_S,
        frames: 1,
        command: [0.0, speed],
        moving: true,
        anchor: k == 0,
        pose_frames: 1,
        pose: [
            travel_m * (cos * ahead - sin * across),
            travel_m * (sin * ahead + cos * across),
            heading,
        ],
        ..Observation::default()
    };
    for wheel in 0..robot.wheels.len() {
        let rolling = rolling_rate(robot, wheel, 0.0, speed);
        let (rate, _) = model.nominal.rates[wheel].rate(rolling, 0.0);
        observation.wheels[wheel] = read(rate);
        observation.steer[wheel] = read(0.0);
    }
    change(&mut observation);
    observation
}

fn read(mean: f64) -> Reading {
    Reading {
        plain: 1,
        mean,
        ..Reading::default()
    }
}

/// Observations until the promise is reached, of 400 after 100 healthy ones.
fn seen_after(channels: Channels, change: impl Fn(u32, &mut Observation)) -> Option<u32> {
    let mut monitor = monitor(channels);
    for k in 0..100 {
        monitor.step(&observation(k, |_| {}), false);
        // Without noise no sum exceeds the time.
        assert!(monitor.hours() <= f64::from(k + 1) * DT_S / 3600.0);
    }
    (1..=400).find(|&k| {
        monitor.step(&observation(100 + k, |it| change(k, it)), false);
        monitor.hours() >= PROMISE.interval_h
    })
}

#[test]
fn a_healthy_drive_at_the_tolerance_is_never_a_fault_and_twice_beyond_it_is() {
    let Tolerance {
        wheel_ratio,
        wheel_rate_rad_s,
        steer_rad,
        yaw_rad_m,
        ..
    } = ROBOT.tolerance.unwrap();
    let rolling = rolling_rate(&ROBOT, 1, 0.0, 0.2);
    let rate = wheel_ratio * rolling + wheel_rate_rad_s;
    for (share, seen) in [(0.99, false), (3.0, true)] {
        let wheel = |_, it: &mut Observation| it.wheels[1].mean -= share * rate;
        let steer = |_, it: &mut Observation| it.steer[0].mean += share * steer_rad;
        let turned = |k: u32| share * yaw_rad_m * 0.2 * DT_S * f64::from(k);
        let yaw = |k, it: &mut Observation| it.pose[2] += turned(k);
        let all = Channels::PoseEncoders;
        assert_eq!(seen_after(all, wheel).is_some(), seen, "wheel {share}");
        assert_eq!(seen_after(all, steer).is_some(), seen, "steer {share}");
        let yaw = seen_after(Channels::Pose, yaw);
        assert_eq!(yaw.is_some(), seen, "yaw {share}");
    }
}

#[test]
fn wheels_that_stand_or_repeat_themselves_are_seen_and_not_by_the_pose_alone() {
    let stands = |_, it: &mut Observation| it.wheels[2] = read(0.0);
    assert_eq!(seen_after(Channels::PoseEncoders, stands), Some(3));
    assert_eq!(seen_after(Channels::Pose, stands), None);
    let frozen = |_, it: &mut Observation| {
        it.wheels[2] = Reading {
            repeats: 1,
            ..Reading::default()
        };
    };
    let seen = seen_after(Channels::PoseEncoders, frozen);
    assert!(seen.is_some_and(|after| after <= 5), "{seen:?}");
}

#[test]
fn a_stop_costs_what_blocks_under_way_have_and_a_missing_pose_does_not() {
    let mut monitor = monitor(Channels::Pose);
    let slides = |k: u32, it: &mut Observation| it.pose[1] += 0.004 * f64::from(k);
    for k in 0..200 {
        monitor.step(&observation(k, |it| slides(k, it)), true);
    }
    let held = monitor.report().channels[Slot::POSE];
    assert!(held > PROMISE.alarm_log_odds());
    assert_eq!(monitor.report().log_odds, held);
    let missing = observation(200, |it| it.pose_frames = 0);
    monitor.step(&missing, true);
    assert_eq!(monitor.report().channels[Slot::POSE], held);
    for k in 200..205 {
        monitor.step(&observation(k, |it| slides(k, it)), true);
    }
    let stands = observation(205, |it| (it.moving, it.command) = (false, [0.0; 2]));
    monitor.step(&stands, true);
    // Those that still wait have none under way.
    assert!(monitor.report().channels[Slot::POSE] < held);
    monitor.forget_evidence();
    assert_eq!(monitor.report().log_odds, LOG_ODDS_MIN);
}

#[test]
fn an_alarm_is_that_of_the_promise_whatever_the_prior_rate() {
    for rate_1_h in [1e-9, 1e-3, 1.0, 3600.0] {
        let promise = Promise {
            fault_rate_1_h: rate_1_h,
            ..PROMISE
        };
        let alarm = promise.alarm_log_odds();
        assert!(alarm >= 0.0);
        assert!(promise.log_odds(23.99) < alarm && promise.log_odds(24.01) > alarm);
    }
    assert!((PROMISE.alarm_log_odds() - 24.0_f64.ln()).abs() < 1e-12);
}

#[test]
fn without_tolerances_nothing_is_promised() {
    let robot = Description {
        tolerance: None,
        ..ROBOT.clone()
    };
    let refused = Monitor::new(&MODEL, &robot, Channels::Pose, NULL, PROMISE).map(|_| ());
    assert!(refused.unwrap_err().to_string().contains("add [tolerance]"));
    let model = RobotModel::Faults(Box::new(MODEL.clone()));
    assert!(tolerance(&model, &robot).is_err());
}
