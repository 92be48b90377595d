//! Where a steering servo stands that does not do as it is told, given the hypothesis that it does
//! not.
//!
//! It is off its commanded angle by a constant, as after a slip or with a bent sensor, or stands at
//! one angle whatever it is told. Both are linear in one unknown, so each belief is Gaussian and
//! the likelihood of a reading integrates over it; which of the two it is, is one more Bayes step.

use vigil_blocks::SizeKind;
use vigil_checkpoint::CheckpointValue;
use vigil_inference::logspace::{log_add, probability};
use vigil_inference::size::{Prior, Size};
use vigil_robot::Description;
use vigil_robot::learned::wheel_context::FAR_SD;
use vigil_robot::learned::{ANY_ANGLE_SD_RAD, SteerReading};

/// Tolerance of a robot that declares none, rad: three deviations of a sensor's noise.
const UNDECLARED_RAD: f64 = 0.01;
/// Deviation by which an angle wanders from one reading to the next, over the tolerance: by about
/// one tolerance in two minutes.
const WANDERS: f64 = 0.02;

/// What is believed of one servo.
#[derive(Debug, Clone, Copy, PartialEq, CheckpointValue)]
pub struct ServoFault {
    /// Angle off the commanded one, rad: beyond the tolerance.
    offset: Size,
    /// Angle at which it stands, rad.
    held: Size,
    /// Log-odds that it stands at one angle.
    log_held: f64,
}

/// What is known of a servo before any reading.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ServoPrior {
    offset: Prior,
    held: Prior,
}

impl ServoPrior {
    /// For the servos of this robot.
    #[must_use]
    pub fn new(robot: &Description) -> Self {
        let tolerance = robot.tolerance.as_ref();
        let healthy_rad = tolerance.map_or(UNDECLARED_RAD, |tolerance| tolerance.steer_rad);
        let prior = |healthy: [f64; 2]| Prior {
            mean: [0.0; 2],
            sd: [ANY_ANGLE_SD_RAD, 0.0],
            wander: [WANDERS * healthy_rad, 0.0],
            healthy,
        };
        Self {
            offset: prior([-healthy_rad, healthy_rad]),
            held: prior([f64::INFINITY, f64::INFINITY]),
        }
    }
}

impl ServoFault {
    /// A servo that begins to stand off a commanded angle, rad.
    #[must_use]
    pub fn new(prior: &ServoPrior, commanded_rad: f64) -> Self {
        let held = Prior {
            mean: [commanded_rad, 0.0],
            ..prior.held
        };
        Self {
            offset: Size::new(&prior.offset),
            held: Size::new(&held),
            log_held: 0.0,
        }
    }

    /// Takes a reading; its log-density over that of a servo that does as it is told.
    pub fn step(&mut self, prior: &ServoPrior, reading: &SteerReading) -> f64 {
        let by = [1.0, 0.0];
        let heard = |size: &mut Size, prior: &Prior, base_rad: f64| {
            size.predict(0.0, prior);
            let (angle, variance) = size.expected(by);
            let log = reading.log_ratio(base_rad + angle, variance);
            let before = size.log_material();
            let residual = reading.read_rad - base_rad - angle;
            if residual * residual <= FAR_SD * FAR_SD * (variance + reading.variance) {
                size.update(by, reading.read_rad - base_rad, reading.variance, prior);
            }
            log + size.log_material() - before
        };
        let (mut at_offset, mut at_held) = (self.offset, self.held);
        let offset = heard(&mut at_offset, &prior.offset, reading.commanded_rad);
        let held = heard(&mut at_held, &prior.held, 0.0);
        if !(offset.is_finite() && held.is_finite()) {
            return 0.0;
        }
        (self.offset, self.held) = (at_offset, at_held);
        let p_held = probability(self.log_held);
        self.log_held += held - offset;
        log_add((1.0 - p_held).ln() + offset, p_held.ln() + held)
    }

    /// In which way it is broken, the angle in rad, and its standard deviation.
    #[must_use]
    pub fn size(&self) -> (SizeKind, (f64, f64)) {
        if self.log_held > 0.0 {
            (SizeKind::HeldAtRad, self.held.estimate())
        } else {
            (SizeKind::AngleRad, self.offset.estimate())
        }
    }
}
