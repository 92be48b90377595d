//! An encoder that reads noise reads right now and then: that is no end of its fault.

use vigil_blocks::SensorFrame;
use vigil_robot::ChannelMap;
use vigil_robot::learned::wheel_evidence::{BREAKAGES, WheelEvidence};
use vigil_robot::learned::wheels::rolling_rate;
use vigil_robot::learned::{EncoderState, NoiseScales, Observer, WheelContext};

use crate::learned::{model, robot};

/// By how much likelier an observation is if the encoder of wheel 2 reads noise than if it is
/// whole, where it is off by `off_rad_s`.
fn log_ratio(off_rad_s: f64) -> f64 {
    let (robot, model) = (robot(), model());
    let map = ChannelMap::new(&robot);
    let mut observer = Observer::new(&model, &robot);
    let mut t_ns = 1_000_000_000;
    loop {
        t_ns += 10_000_000;
        let mut frame = SensorFrame {
            run_id: 1,
            ..SensorFrame::default()
        };
        frame.header.t_capture_ns = t_ns;
        frame.set_command(0, 0.0);
        frame.set_command(1, 0.2);
        map.set_pose(&mut frame, [0.2 * t_ns as f64 * 1e-9, 0.0, 0.0]);
        // No two samples of an encoder are the same.
        let dither = 1e-3 * (t_ns / 10_000_000 % 7) as f64;
        for wheel in 0..robot.wheels.len() {
            let rate = rolling_rate(&robot, wheel, 0.0, 0.2) + dither;
            map.set_wheel_rate(&mut frame, wheel, rate);
        }
        frame.channel[3 + 2] += off_rad_s;
        if observer.push(&frame).complete && t_ns > 3_000_000_000 {
            break;
        }
    }
    let context = WheelContext::new(robot.tolerance);
    let scales = NoiseScales::default();
    let evidence = WheelEvidence::new(&model, &robot, observer.observation(), scales, &context);
    let noise = BREAKAGES
        .iter()
        .position(|state| *state == EncoderState::Noise);
    evidence.broken[2][noise.expect("noise is a breakage")] - evidence.healthy[2]
}

#[test]
fn a_right_reading_says_little_against_noise_and_a_wrong_one_much_for_it() {
    let right = log_ratio(0.0);
    assert!((-2.5..-1.0).contains(&right), "{right}");
    let wrong = log_ratio(3.0);
    assert!(wrong > 3.0, "{wrong}");
}
