//! How much a fault changes what is measured, in units of what a nominal rover leaves uncertain.
//!
//! The same world, without sensor noise, is driven twice, with and without the fault. In each a
//! Kalman track of the nominal model follows the poses; the difference of the two innovations,
//! whitened by their covariance, is the mean shift of an otherwise white sequence. The squares of
//! that shift add up to the noncentrality: twice the log-likelihood ratio that a detector can have
//! on average, at most. The track is put onto its first pose and never anchored again. Wheel
//! rates and steering angles add theirs; what a healthy wheel is off by is a constant of the run,
//! of which the readings before the onset have told most.

use nalgebra::Matrix3;
use vigil_blocks::{SensorFrame, Valid, WHEELS};
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
        let variance = observation.pose_variance(model, [1.0; 3]);
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
    let mut pose = 0.0;
    let pairs = healthy.steps.iter().zip(&faulty.steps);
    for (a, b) in pairs.take(to).skip(from) {
        if let (Some((a, spread)), Some((b, _))) = (a.innovation, b.innovation) {
            let mut apart = nalgebra::Vector3::from(b) - nalgebra::Vector3::from(a);
            apart[2] = vigil_inference::angle::wrap(apart[2]);
            let inverse = spread.try_inverse().unwrap_or_else(Matrix3::zeros);
            pose += (apart.transpose() * inverse * apart)[0];
        }
    }
    [pose, pose + readings(healthy, faulty, from, to)]
}

/// A channel whose healthy readings are off by a constant of the run, and white noise besides.
#[derive(Debug, Clone, Copy, Default)]
struct Shift {
    /// Sum of the squares of the differences over the noise's variance.
    squares: f64,
    /// Sum of the differences over the noise's variance.
    sum: f64,
    /// Variance of the constant.
    offset: f64,
    /// Readings of the run so far, each over the noise's variance.
    known: f64,
}

impl Shift {
    fn add(&mut self, apart: f64, offset: f64, noise: f64) {
        self.squares += apart * apart / noise;
        self.sum += apart / noise;
        self.offset = offset;
    }

    /// `d' (S + v 11')^-1 d` over the whole run, of which only the end differs: readings before the
    /// onset have told most of the constant.
    fn noncentrality(&self) -> f64 {
        if self.offset <= 0.0 {
            return self.squares;
        }
        self.squares - self.sum * self.sum / (1.0 / self.offset + self.known)
    }
}

/// What wheel rates and steering angles say from frame `from` up to `to`.
fn readings(healthy: &Follower<'_>, faulty: &Follower<'_>, from: usize, to: usize) -> f64 {
    let (model, robot) = (&healthy.rover.model, &healthy.rover.robot);
    let noise = |sd: f64| model.sample_variance(sd, model.interval_s);
    let (rate_noise, steer_noise) = (
        noise(model.noise.wheel_rate_rad_s),
        noise(model.noise.steer_rad),
    );
    let mut rates = [Shift::default(); WHEELS];
    let mut angles = [Shift::default(); WHEELS];
    for (k, (a, b)) in healthy.steps.iter().zip(&faulty.steps).take(to).enumerate() {
        for i in 0..robot.wheels.len().min(WHEELS) {
            let has = |bit| a.frame.has(bit) && b.frame.has(bit);
            if has(Valid::wheel_rate(i)) {
                rates[i].known += 1.0 / rate_noise;
                let rate = a.frame.wheel_rate[i];
                let (_, offset) = model.nominal.rates[i].rate(rate, a.curvature);
                if k >= from {
                    rates[i].add(b.frame.wheel_rate[i] - rate, offset, rate_noise);
                }
            }
            if has(Valid::steer(i)) {
                angles[i].known += 1.0 / steer_noise;
                let offset = model.nominal.steer_sd_rad * model.nominal.steer_sd_rad;
                if k >= from {
                    angles[i].add(b.frame.steer[i] - a.frame.steer[i], offset, steer_noise);
                }
            }
        }
    }
    rates.iter().chain(&angles).map(Shift::noncentrality).sum()
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use crate::simulated::{Conditions, constant};
    use nalgebra::{DMatrix, DVector};
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
        let follow = |changes: &[_]| {
            let mut follower = Follower::new(rover);
            let take = |_, frame: &SensorFrame| follower.take(frame);
            conditions.drive(rover, 6.0, changes, take).unwrap();
            follower
        };
        between(&follow(&[]), &follow(&[(change, ONSET_S)]), 80, 120)
    }

    #[test]
    fn readings_beside_the_pose_add_their_squares_and_the_pose_its_innovations() {
        let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
        let rover = Rover::read(&root).unwrap();
        assert_eq!(found(&rover, "clear:all"), [0.0, 0.0]);
        // 40 readings of one encoder, each off by a tenth of about 2.5 rad/s.
        let model = &rover.model;
        let [pose, all] = found(&rover, "encoder-scale:LM:1.1");
        assert_eq!(pose, 0.0);
        // Covariance of all 120 readings of the run: white noise, and one constant.
        let (_, offset) = model.nominal.rates[1].rate(2.49, 0.0);
        let noise = model.sample_variance(model.noise.wheel_rate_rad_s, 0.05);
        let covariance = DMatrix::from_element(120, 120, offset)
            + DMatrix::from_diagonal_element(120, 120, noise);
        let shift = DVector::from_fn(120, |k, _| if k < 80 { 0.0 } else { 0.249 });
        let expected = shift.dot(&covariance.lu().solve(&shift).unwrap());
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
