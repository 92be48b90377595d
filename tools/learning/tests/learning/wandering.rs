//! A channel whose level wanders without a fault, such as a battery's voltage.

use vigil_blocks::SensorFrame;
use vigil_learning::channel_learning::{Log, learn};
use vigil_recording::frames::Run;
use vigil_robot::Description;
use vigil_robot::channel_model::Model;
use vigil_robot::slot::Slot;

use super::channel_sensing::{alarm, run, stop_and_go};
use super::several_faults::{ONSET_S, share, shares};
use super::small::small;

/// Place of the voltage in a frame.
const VOLTAGE: usize = 5;

fn robot(drifts: &str) -> Description {
    small(&format!(
        "measured = {{ pose = true, wheel_rates = true, steer = false }}\npolynomial_order = 1\n\
         [[channel]]\nname = \"battery\"\nrole = \"voltage\"\nunit = \"V\"\n{drifts}"
    ))
}

/// A run whose battery has this voltage at its start and loses so much each second; the load takes
/// more.
fn discharge(id: u32, length_s: f64, from_and_fall: (f64, f64)) -> Run {
    let mut run = run(id, length_s, stop_and_go, stop_and_go);
    supply(&mut run, from_and_fall);
    run
}

fn supply(run: &mut Run, (from, falls_1_s): (f64, f64)) {
    for (i, frame) in run.frames.iter_mut().enumerate() {
        let t_s = frame.header.t_capture_ns as f64 * 1e-9;
        let load = frame.channel[3].abs() + frame.channel[4].abs();
        let ripple = 0.02 * f64::from(i as u32 * 7919 % 101) / 101.0;
        frame.set_channel(VOLTAGE, from - falls_1_s * t_s - 0.01 * load + ripple);
    }
}

/// The model of two runs in which the battery empties.
fn learned(robot: &Description) -> Model {
    let runs = [
        discharge(0, 400.0, (25.0, 5e-4)),
        discharge(1, 400.0, (24.6, 5e-4)),
    ];
    learn(&Log::of_healthy(&runs), robot).unwrap().0
}

#[test]
fn a_battery_that_empties_is_no_fault_and_one_that_breaks_down_is() {
    let robot = robot("");
    let model = learned(&robot);
    // Far below all that was learned from, from the start and in the end.
    for (id, from) in [(10, 24.8), (11, 22.0), (12, 27.0)] {
        let healthy = discharge(id, 1200.0, (from, 8e-4));
        assert_eq!(alarm(&model, &robot, &healthy), None, "from {from} V");
    }
    type Spoil = fn(&mut SensorFrame);
    let spoils: [Spoil; 3] = [
        |frame| frame.channel[VOLTAGE] -= 1.0,
        |frame| frame.channel[VOLTAGE] *= 0.8,
        |frame| frame.channel[VOLTAGE] = 0.0,
    ];
    for (i, spoil) in spoils.into_iter().enumerate() {
        let mut broken = discharge(20 + i as u32, 120.0, (23.0, 5e-4));
        broken.frames.iter_mut().skip(1200).for_each(spoil);
        let (found_s, channel) = alarm(&model, &robot, &broken).unwrap();
        assert!((60.0..63.0).contains(&found_s), "{i}: {found_s} s");
        assert_eq!(channel, Slot::further(VOLTAGE), "{i}");
    }
}

#[test]
fn a_level_that_no_log_has_shown_hides_no_fault_of_another_component() {
    let robot = robot("");
    let model = learned(&robot);
    // The left wheel does half of what it is told.
    let obeys = |t_s: f64| match stop_and_go(t_s) {
        moves if t_s < ONSET_S => moves,
        [v, w] => {
            let (left, right) = (0.5 * (v - 0.1 * w), v + 0.1 * w);
            [0.5 * (right + left), 5.0 * (right - left)]
        }
    };
    for from in [24.8, 18.0, 29.0] {
        let mut stuck = run(30, 60.0, stop_and_go, obeys);
        supply(&mut stuck, (from, 5e-4));
        let (found_s, _) = alarm(&model, &robot, &stuck).unwrap();
        assert!(
            (ONSET_S..12.0).contains(&found_s),
            "from {from} V: {found_s} s"
        );
        let found = shares(&model, &robot, &stuck, ["drive_L", "drive_R"]);
        assert!(share(&found, "drive_L") > 0.7, "from {from} V: {found:?}");
    }
}

#[test]
fn a_glitch_at_the_start_is_no_level() {
    let robot = robot("");
    let model = learned(&robot);
    for glitch in [0.0, 1e308, -1e308] {
        let mut healthy = discharge(40, 300.0, (24.8, 5e-4));
        for frame in healthy.frames.iter_mut().take(4) {
            frame.channel[VOLTAGE] = glitch;
        }
        // Before a second has passed no evidence counts.
        assert_eq!(alarm(&model, &robot, &healthy), None, "{glitch}");
    }
}

#[test]
fn a_channel_that_is_said_to_stay_is_held_to_its_level() {
    let robot = robot("drifts = false");
    let runs = [
        discharge(0, 400.0, (25.0, 0.0)),
        discharge(1, 400.0, (25.0, 0.0)),
    ];
    let (model, _) = learn(&Log::of_healthy(&runs), &robot).unwrap();
    let low = discharge(11, 60.0, (22.0, 0.0));
    let (_, channel) = alarm(&model, &robot, &low).unwrap();
    assert_eq!(channel, Slot::further(VOLTAGE));
    // Whether a level wanders is a part of what was learned.
    assert!(model.check_robot(&self::robot("")).is_err());
}
