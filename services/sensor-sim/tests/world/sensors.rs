//! Noise, validity, determinism.

use vigil_blocks::{CHANNELS, SensorFrame};
use vigil_robot::{ChannelMap, FaultKind};
use vigil_sensor_sim::World;
use vigil_setup::graph_file::Simulator;

use crate::rover::{drive, fault, measure, robot, segment};

/// Picks one number of a frame.
type Channel = fn(&SensorFrame) -> f64;

/// Samples of one channel of a rover at rest, where the truth is 0 in every channel.
fn at_rest(rate_hz: f64, noise_scale: f64, channel: Channel) -> Vec<f64> {
    let settings = Simulator {
        noise_scale,
        ..Simulator::default()
    };
    let mut world = World::new(&robot(), &settings, &[], rate_hz, 11).unwrap();
    (0..40_000).map(|_| channel(&measure(&mut world))).collect()
}

fn moments(samples: &[f64]) -> (f64, f64, f64) {
    let n = samples.len() as f64;
    let mean = samples.iter().sum::<f64>() / n;
    let variance = samples.iter().map(|s| (s - mean).powi(2)).sum::<f64>() / n;
    let lagged = samples.windows(2).map(|w| (w[0] - mean) * (w[1] - mean));
    (mean, variance, lagged.sum::<f64>() / n / variance)
}

#[test]
fn noise_carries_equal_information_per_second_at_any_rate() {
    let noise = robot().noise;
    let channels: [(&str, f64, Channel); 7] = [
        ("x", noise.position_m, |f| f.channel[0]),
        ("y", noise.position_m, |f| f.channel[1]),
        ("yaw", noise.yaw_rad, |f| f.channel[2]),
        ("yaw rate", noise.yaw_rate_rad_s, |f| f.channel[13]),
        ("wheel rate", noise.wheel_rate_rad_s, |f| f.channel[3 + 4]),
        ("steer", noise.steer_rad, |f| f.channel[12]),
        ("current", noise.current_a, |f| f.channel[14 + 1]),
    ];
    for rate_hz in [20.0, 100.0, 1000.0] {
        for (name, sigma, channel) in channels {
            let samples = at_rest(rate_hz, 2.0, channel);
            let (mean, variance, correlation) = moments(&samples);
            // Variance of the mean over one second, against the reference rate's.
            let per_second = variance / rate_hz;
            let expected = (2.0 * sigma).powi(2) / 20.0;
            let n = samples.len() as f64;
            let what = format!("{name} at {rate_hz} Hz");
            // Five standard errors each.
            let ratio = per_second / expected;
            assert!(
                (ratio - 1.0).abs() < 5.0 * (2.0 / n).sqrt(),
                "{what}: {ratio}"
            );
            assert!(
                mean.abs() < 5.0 * (variance / n).sqrt(),
                "{what}: mean {mean}"
            );
            assert!(correlation.abs() < 5.0 / n.sqrt(), "{what}: not white");
            let within = samples.iter().filter(|s| s.powi(2) < variance).count();
            let share = within as f64 / n;
            assert!(
                (share - 0.6827).abs() < 0.012,
                "{what}: {share} within 1 sigma"
            );
        }
    }
}

#[test]
fn without_noise_every_channel_tells_the_truth() {
    let settings = Simulator {
        noise_scale: 0.0,
        friction_scatter: 0.0,
        ..Simulator::default()
    };
    let segments = [segment(100.0, 0.5, 0.2)];
    let mut world = World::new(&robot(), &settings, &segments, 100.0, 1).unwrap();
    drive(&mut world, 100.0, 1000);
    let (frame, truth) = (measure(&mut world), world.true_state());
    assert_eq!(frame.channel[..3], truth.pose);
    assert_eq!(frame.channel[13], truth.velocity[2]);
    assert_eq!(frame.channel[3..9], truth.wheel_rate_rad_s);
    assert_eq!(frame.command[..3], [0.5, 0.2, 0.0]);
    let inner = f64::atan2(0.35, 1.7);
    let [front, rear] = [frame.channel[9], frame.channel[10]];
    assert!((front - inner).abs() < 1e-12 && (rear + inner).abs() < 1e-12);
    // The reference values of a left turn of 2 m.
    assert!((frame.channel[3] - 2.159).abs() < 6e-4, "{frame:?}");
    assert!((frame.channel[13] - 0.09959).abs() < 6e-6, "{frame:?}");
}

#[test]
fn exactly_what_is_measured_is_valid() {
    let mut world = World::new(&robot(), &Simulator::default(), &[], 100.0, 1).unwrap();
    let mut frame = SensorFrame {
        symptoms: 3,
        channel: [7.0; CHANNELS],
        channel_valid: u64::MAX,
        ..SensorFrame::default()
    };
    frame.header.seq = 42;
    world.measure(&mut frame);
    // Pose, six rates, four angles, gyro, six currents.
    assert_eq!(frame.channel_valid, (1 << (3 + 6 + 4 + 1 + 6)) - 1);
    assert_eq!((frame.command_valid, frame.planned_pose_valid), (0b11, 1));
    assert_eq!(frame.robot_hash, ChannelMap::new(&robot()).hash());
    assert_eq!((frame.header.seq, frame.run_id), (42, 1));
    assert_eq!(frame.symptoms, 0);
    assert_eq!(frame.channel[20..], [0.0; CHANNELS - 20]);
    world.set_run_id(9);
    assert_eq!(measure(&mut world).run_id, 9);
}

#[test]
fn equal_seeds_give_equal_bits_and_others_do_not() {
    let run = |seed: u64| {
        let segments = [segment(2.0, 0.5, 0.2), segment(2.0, -0.5, 0.3)];
        let settings = Simulator::default();
        let mut world = World::new(&robot(), &settings, &segments, 200.0, seed).unwrap();
        let mut frames = Vec::new();
        for step in 0..1200 {
            drive(&mut world, 200.0, 1);
            if step == 600 {
                world.inject(fault(FaultKind::Stuck, 4)).unwrap();
                world.inject(fault(FaultKind::EncoderNoise, 0)).unwrap();
            }
            frames.push(measure(&mut world));
        }
        frames
    };
    let bits = |frames: &[SensorFrame]| -> Vec<u64> {
        let numbers = frames.iter().flat_map(|f| f.channel);
        numbers.map(f64::to_bits).collect()
    };
    let (first, again, other) = (run(3), run(3), run(4));
    assert_eq!(bits(&first), bits(&again));
    assert!(first == again);
    assert_ne!(bits(&first), bits(&other));
}

#[test]
fn yaw_stays_wrapped_on_a_long_turn() {
    let segments = [segment(1e6, 1.0, 0.4)];
    let settings = Simulator::default();
    let mut world = World::new(&robot(), &settings, &segments, 20.0, 1).unwrap();
    for _ in 0..1000 {
        drive(&mut world, 20.0, 1);
        let frame = measure(&mut world);
        assert!(frame.channel[2].abs() <= std::f64::consts::PI);
        assert!(frame.planned_pose[2].abs() <= std::f64::consts::PI);
    }
    assert!(world.true_state().pose[2] > 15.0);
}
