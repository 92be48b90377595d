//! How noisy the sensors are is known however unevenly their frames come.

use rand::{RngExt, SeedableRng};
use rand_distr::StandardNormal;
use rand_pcg::Pcg64Mcg;
use vigil_blocks::SensorFrame;
use vigil_robot::Suspects;
use vigil_robot::learned::noise_scale::{NoiseScale, SensorNoise};
use vigil_robot::learned::wheels::rolling_rate;
use vigil_robot::learned::{NoiseScales, Observation, Observer, Reading};

use crate::learned::{model, robot};

/// Factor on the learned noise of every sensor.
const NOISIER: f64 = 1.6;
const OUTLIERS: f64 = 0.01;
/// Of an outlier, in deviations of the learned noise.
const FAR: f64 = 20.0;
const WHEELS: usize = 6;

/// What is believed after a minute on a circle, at 20 Hz: each frame comes within a share of its
/// period, and a share of them not at all.
fn scales(jitter: f64, loss: f64) -> NoiseScales {
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
        frame.set_command(0, curvature);
        frame.set_command(1, speed);
        let yaw = curvature * speed * t_s;
        let pose = [yaw.sin() / curvature, (1.0 - yaw.cos()) / curvature, yaw];
        let sd = [
            model.noise.position_m,
            model.noise.position_m,
            model.noise.yaw_rad,
        ];
        for i in 0..3 {
            frame.set_channel(i, pose[i] + normal(sd[i]));
        }
        for wheel in 0..robot.wheels.len() {
            let rate = rolling_rate(&robot, wheel, curvature, speed);
            frame.set_channel(3 + wheel, rate + normal(model.noise.wheel_rate_rad_s));
        }
        for wheel in 0..robot.wheels.len() {
            if rng.random::<f64>() < OUTLIERS {
                frame.channel[3 + wheel] += FAR * model.noise.wheel_rate_rad_s;
            }
        }
        if rng.random::<f64>() >= loss && observer.push(&frame).complete {
            noise.update(&model, &robot, observer.observation(), Suspects::default());
        }
    }
    noise.scales()
}

#[test]
fn noise_and_outliers_are_known_however_unevenly_frames_come() {
    for (jitter, loss) in [(0.0, 0.0), (0.5, 0.0), (0.9, 0.0), (0.0, 0.3), (0.9, 0.3)] {
        let scales = scales(jitter, loss);
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
fn noise_of_a_suspected_wheel_is_believed_once_it_has_settled_as_a_healthy_one_may() {
    let model = model();
    let sd = model.noise.wheel_rate_rad_s;
    let mut rng = Pcg64Mcg::seed_from_u64(9);
    // After a minute in which all was well the noise is as many times as large, and suspected.
    let mut ratio_after = |factor: f64, seconds: usize| {
        let mut scale = NoiseScale::default();
        let observation = Observation {
            frame_s: 0.05,
            ..Observation::default()
        };
        let mut last = Reading::default();
        for k in 0..20 * (60 + seconds) {
            let is_suspected = k >= 1200;
            let sd = if is_suspected { factor * sd } else { sd };
            let mut now = last.next();
            now.push(sd * rng.sample::<f64, _>(StandardNormal), None);
            let read = [&last, &now];
            scale.push_step(
                &model,
                &observation,
                model.noise.wheel_rate_rad_s,
                read,
                0.0,
                is_suspected,
            );
            last = now;
        }
        scale.variance_ratio().sqrt()
    };
    let held = ratio_after(4.0, 10);
    assert!((0.85..1.4).contains(&held), "{held}");
    let adopted = ratio_after(4.0, 60);
    assert!((3.4..5.0).contains(&adopted), "{adopted}");
    for seconds in [2, 10, 20, 60, 600] {
        let broken = ratio_after(10.0, seconds);
        assert!((0.85..1.4).contains(&broken), "{seconds} s: {broken}");
    }
}
