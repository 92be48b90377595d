//! How much a fault changes what is measured, in units of what a nominal rover leaves uncertain.
//!
//! The same world, without sensor noise, is driven twice, with and without the fault. In each a
//! Kalman track of the nominal model follows the poses; the difference of the two innovations,
//! whitened by their covariance, is the mean shift of an otherwise white sequence. The squares of
//! that shift add up to the noncentrality: twice the log-likelihood ratio that a detector can have
//! on average, at most. The track is put onto its first pose and never anchored again. Wheel
//! rates and steering angles add the squares of their differences over the variance of a reading.

use nalgebra::Matrix3;
use vigil_blocks::{SensorFrame, Valid};
use vigil_inference::track::Track;
use vigil_robot::learned::{Observation, Observer};

use crate::simulated::Rover;

/// What one frame of a run leaves: the pose's innovation and the readings beside it.
#[derive(Debug, Clone, Copy)]
struct Step {
    innovation: Option<([f64; 3], Matrix3<f64>)>,
    frame: SensorFrame,
    curvature: f64,
}

/// Follows one run.
#[derive(Debug)]
pub struct Follower<'a> {
    rover: &'a Rover,
    observer: Observer,
    track: Option<Track>,
    steps: Vec<Step>,
}

impl<'a> Follower<'a> {
    /// Of a run of this rover.
    #[must_use]
    pub fn new(rover: &'a Rover) -> Self {
        Self {
            rover,
            observer: Observer::new(&rover.model, &rover.robot),
            track: None,
            steps: Vec::new(),
        }
    }

    /// Takes a frame; frames must come at the interval of the model.
    pub fn take(&mut self, frame: &SensorFrame) {
        self.observer.push(frame);
        let observation = *self.observer.observation();
        let innovation = self.innovation(&observation);
        self.steps.push(Step {
            innovation,
            frame: *frame,
            curvature: observation.command[0],
        });
    }

    fn innovation(&mut self, observation: &Observation) -> Option<([f64; 3], Matrix3<f64>)> {
        let model = &self.rover.model;
        let motion = &model.nominal.motion;
        let variance = observation.pose_variance(model, 1.0);
        let has_pose = observation.pose_frames > 0;
        let Some(track) = &mut self.track else {
            let spread = Matrix3::from_diagonal(&variance.into());
            let start = || Track::new(observation.pose.into(), spread, &motion.noise());
            self.track = has_pose.then(start);
            return None;
        };
        if observation.moving {
            track.predict(&observation.displacement(model, motion), &motion.noise());
        }
        if !has_pose {
            return None;
        }
        let (apart, spread) = track.innovation(observation.pose, variance);
        track.update(observation.pose, variance)?;
        Some((apart.into(), spread))
    }
}

/// Noncentrality of the pose alone, and of pose, wheel rates and steering angles together, over
/// the frames `from..to` of two runs of the same world.
#[must_use]
pub fn between(healthy: &Follower<'_>, faulty: &Follower<'_>, from: usize, to: usize) -> [f64; 2] {
    let (mut pose, mut wheels) = (0.0, 0.0);
    let pairs = healthy.steps.iter().zip(&faulty.steps);
    for (a, b) in pairs.take(to).skip(from) {
        if let (Some((a, spread)), Some((b, _))) = (a.innovation, b.innovation) {
            let mut apart = nalgebra::Vector3::from(b) - nalgebra::Vector3::from(a);
            apart[2] = vigil_inference::angle::wrap(apart[2]);
            let inverse = spread.try_inverse().unwrap_or_else(Matrix3::zeros);
            pose += (apart.transpose() * inverse * apart)[0];
        }
        wheels += readings(healthy.rover, a, b);
    }
    [pose, pose + wheels]
}

/// Squares of the differences of wheel rates and steering angles over their variances.
fn readings(rover: &Rover, healthy: &Step, faulty: &Step) -> f64 {
    let (model, robot) = (&rover.model, &rover.robot);
    let sample = |sd: f64| model.sample_variance(sd, model.interval_s);
    let mut sum = 0.0;
    for i in 0..robot.wheels.len() {
        let (a, b) = (&healthy.frame, &faulty.frame);
        if a.has(Valid::wheel_rate(i)) && b.has(Valid::wheel_rate(i)) {
            let rate = a.wheel_rate[i];
            let (_, process) = model.nominal.rates[i].rate(rate, healthy.curvature);
            let apart = b.wheel_rate[i] - rate;
            sum += apart * apart / (process + sample(model.noise.wheel_rate_rad_s));
        }
        if a.has(Valid::steer(i)) && b.has(Valid::steer(i)) {
            let process = model.nominal.steer_sd_rad * model.nominal.steer_sd_rad;
            let apart = b.steer[i] - a.steer[i];
            sum += apart * apart / (process + sample(model.noise.steer_rad));
        }
    }
    sum
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use crate::simulated::{Conditions, constant};
    use std::path::Path;
    use vigil_robot::Injection;
    use vigil_setup::schema::Simulator;

    const ONSET_S: f64 = 4.0;

    fn found(rover: &Rover, spec: &str) -> [f64; 2] {
        let change = Injection::parse_change(spec, &rover.robot).unwrap();
        let conditions = Conditions {
            simulator: Simulator {
                noise_scale: 0.0,
                ..Simulator::default()
            },
            drive: constant(0.0, 0.2),
            rate_hz: 20.0,
            seed: 3,
        };
        let follow = |change| {
            let mut follower = Follower::new(rover);
            let take = |_, frame: &SensorFrame| follower.take(frame);
            conditions.drive(rover, 6.0, change, take).unwrap();
            follower
        };
        between(&follow(None), &follow(Some((change, ONSET_S))), 80, 120)
    }

    #[test]
    fn readings_beside_the_pose_add_their_squares_and_the_pose_its_innovations() {
        let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
        let rover = Rover::read(&root).unwrap();
        assert_eq!(found(&rover, "clear:all"), [0.0, 0.0]);
        // 40 readings of one encoder, each off by a tenth of about 2.5 rad/s.
        let model = &rover.model;
        let [pose, all] = found(&rover, "encoder-scale:LM:1.1");
        let (_, process) = model.nominal.rates[1].rate(2.49, 0.0);
        let variance = process + model.sample_variance(model.noise.wheel_rate_rad_s, 0.05);
        assert_eq!(pose, 0.0);
        let expected = 40.0 * 0.249 * 0.249 / variance;
        assert!((all / expected - 1.0).abs() < 0.02, "{all} {expected}");
        // A late pose: one jump of 0.06 m, which the track follows slowly. No innovation exceeds
        // it, and each has at least the sensor's variance.
        let [pose, all] = found(&rover, "pose-delay:0.3");
        let jump = 0.06_f64.powi(2) / model.noise.position_m.powi(2);
        assert_eq!(pose, all);
        assert!((0.3 * jump..40.0 * jump).contains(&pose), "{pose} {jump}");
        // Without poses there is nothing to compare.
        assert_eq!(found(&rover, "pose-drop"), [0.0, 0.0]);
        // Twice the drift, four times the squares.
        let [slow, _] = found(&rover, "pose-drift:0.01");
        let [fast, _] = found(&rover, "pose-drift:0.02");
        assert!((fast / slow - 4.0).abs() < 0.1, "{slow} {fast}");
    }
}
