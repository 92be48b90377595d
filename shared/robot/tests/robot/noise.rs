//! How noisy the sensors are is known however unevenly their frames come.

use rand::{RngExt, SeedableRng};
use rand_distr::StandardNormal;
use rand_pcg::Pcg64Mcg;
use vigil_blocks::{CHANNELS, Channel, SensorFrame, Valid};
use vigil_robot::Suspects;
use vigil_robot::learned::noise_scale::SensorNoise;
use vigil_robot::learned::wheels::rolling_rate;
use vigil_robot::learned::{NoiseScales, Observer};

use crate::learned::{model, robot};

/// Factor on the learned noise of every sensor.
const NOISIER: f64 = 1.6;
const OUTLIERS: f64 = 0.01;
/// Of an outlier, in deviations of the learned noise.
const FAR: f64 = 20.0;
const WHEELS: usize = 6;

/// What is believed after a minute on a circle, at 20 Hz: each frame comes within a share of its
/// period, and a share of them not at all. What is suspected teaches nothing.
fn scales(jitter: f64, loss: f64, suspects: Suspects) -> NoiseScales {
    let (robot, model) = (robot(), model());
    let mut observer = Observer::new(&model, &robot);
    let mut noise = SensorNoise::default();
    let mut rng = Pcg64Mcg::seed_from_u64(7);
    let (curvature, speed) = (0.5, 0.2);
    for k in 0..1200_u32 {
        let t_s = 0.05 * (f64::from(k) + jitter * (rng.random::<f64>() - 0.5)) + 1.0;
        let mut normal = |sd: f64| NOISIER * sd * rng.sample::<f64, _>(StandardNormal);
        let mut frame = SensorFrame {
            run_id: 1,
            ..SensorFrame::default()
        };
        frame.header.t_capture_ns = (t_s * 1e9).round() as u64;
        frame.command = [curvature, speed, 0.0, 0.0];
        let yaw = curvature * speed * t_s;
        let pose = [yaw.sin() / curvature, (1.0 - yaw.cos()) / curvature, yaw];
        let sd = [
            model.noise.position_m,
            model.noise.position_m,
            model.noise.yaw_rad,
        ];
        frame.pose = std::array::from_fn(|i| pose[i] + normal(sd[i]));
        for wheel in 0..WHEELS {
            let rate = rolling_rate(&robot, wheel, curvature, speed);
            frame.wheel_rate[wheel] = rate + normal(model.noise.wheel_rate_rad_s);
        }
        for wheel in 0..WHEELS {
            if rng.random::<f64>() < OUTLIERS {
                frame.wheel_rate[wheel] += FAR * model.noise.wheel_rate_rad_s;
            }
        }
        frame.valid = Valid::POSE | Valid::command(0) | Valid::command(1) | 0x3f00;
        if rng.random::<f64>() >= loss && observer.push(&frame).complete {
            noise.update(&model, &robot, observer.observation(), suspects);
        }
    }
    noise.scales()
}

#[test]
fn noise_and_outliers_are_known_however_unevenly_frames_come() {
    for (jitter, loss) in [(0.0, 0.0), (0.5, 0.0), (0.9, 0.0), (0.0, 0.3), (0.9, 0.3)] {
        let scales = scales(jitter, loss, Suspects::default());
        let wheels = &scales.wheels[..WHEELS];
        // Outliers, clipped, and its own uncertainty make it lean to the high side.
        for scale in scales.pose.iter().chain(wheels) {
            let is_near = (0.85 * NOISIER..1.4 * NOISIER).contains(scale);
            assert!(is_near, "{jitter} {loss}: {scales:?}");
        }
        for rate in &scales.outliers.wheels[..WHEELS] {
            let is_near = (0.3 * OUTLIERS..2.5 * OUTLIERS).contains(rate);
            assert!(is_near, "{jitter} {loss}: {scales:?}");
        }
        assert!(
            scales
                .outliers
                .pose
                .iter()
                .all(|rate| *rate < 0.2 * OUTLIERS)
        );
    }
}

#[test]
fn a_wheel_that_is_suspected_teaches_no_noise_and_the_others_do() {
    let mut log_odds = [-5.0; CHANNELS];
    log_odds[Channel::wheel_rate(1)] = 5.0;
    let scales = scales(0.0, 0.0, Suspects::new(true, &log_odds));
    for (wheel, scale) in scales.wheels.iter().enumerate().take(WHEELS) {
        let is_learned = (0.85 * NOISIER..1.4 * NOISIER).contains(scale);
        assert_eq!(is_learned, wheel != 1, "{wheel}: {scale}");
    }
}
