//! What a sensor may say that is wrong: within all bounds, so that the guard lets it pass and the
//! filters must name it.

use std::error::Error;

use vigil_robot::{FrameGuard, Injection};
use vigil_setup::schema::{Sensors, Simulator};

use crate::simulated::{Chain, Conditions, Rover, constant};

/// When the sensor breaks, s.
const ONSET_S: f64 = 4.0;
/// Time in which it must be named, s.
const NAMED_S: f64 = 5.0;
const RATE_HZ: f64 = 20.0;
const RADII_M: [f64; 5] = [1.0, -2.0, 4.0, -6.0, 1e3];
const DRIFTS_M_S: [f64; 4] = [0.02, -0.02, 0.05, -0.05];

/// How an encoder breaks.
pub const ENCODER: [&str; 3] = ["zero", "frozen", "noise"];
/// The pose drifts: no fault of the tree, so that an alarm is all that is expected.
pub const POSE_DRIFT: &str = "pose-drift";

/// One broken sensor.
#[derive(Debug, Clone, PartialEq)]
pub struct Job {
    /// How it breaks: one of [`ENCODER`], or [`POSE_DRIFT`].
    pub how: &'static str,
    wheel: usize,
    seed: u64,
}

/// What came of it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Found {
    /// An alarm after it.
    pub is_detected: bool,
    /// The right encoder was named at the end; false for another sensor.
    pub is_named: bool,
    /// Frames that the guard refused: it must let the filters see them.
    pub refused: u64,
}

/// So many of each kind; the wheels, turns and drifts in turn.
#[must_use]
pub fn jobs(each: usize, first_seed: u64) -> Vec<Job> {
    let of = |how| {
        (0..each).map(move |n| Job {
            how,
            wheel: n % 6,
            seed: first_seed + n as u64,
        })
    };
    let kinds = ENCODER.into_iter().chain([POSE_DRIFT]);
    kinds.flat_map(of).collect()
}

impl Job {
    /// What is injected, as `--inject` takes it.
    fn words(&self, wheel: &str) -> String {
        if self.how == POSE_DRIFT {
            let drift_m_s = DRIFTS_M_S[self.seed as usize % DRIFTS_M_S.len()];
            return format!("{POSE_DRIFT}:{drift_m_s}");
        }
        format!("encoder:{wheel}:{}", self.how)
    }

    /// Drives until it must have been named.
    ///
    /// # Errors
    /// If the rover's models do not fit.
    pub fn run(&self, rover: &Rover) -> Result<Found, Box<dyn Error>> {
        let name = &rover.robot.wheels[self.wheel].name;
        let change = Injection::parse_change(&self.words(name), &rover.robot)?;
        let radius_m = RADII_M[self.seed as usize % RADII_M.len()];
        let conditions = Conditions {
            simulator: Simulator::default(),
            drive: constant(1.0 / radius_m, 0.2),
            rate_hz: RATE_HZ,
            seed: self.seed,
        };
        let mut chain = Chain::new(rover, Sensors::PoseEncoders, self.seed)?;
        let mut guard = FrameGuard::new(&rover.robot);
        let (mut is_detected, mut refused) = (false, 0);
        conditions.drive(
            rover,
            ONSET_S + NAMED_S,
            &[(change, ONSET_S)],
            |t_s, frame| {
                refused += u64::from(guard.check(frame).is_err());
                chain.take(frame);
                is_detected |= t_s >= ONSET_S && chain.said().alarm;
            },
        )?;
        Ok(Found {
            is_detected,
            is_named: chain.said().fault_set == format!("{name}_ENC"),
            refused,
        })
    }
}
