//! Which steering angles are as commanded, in the unknown where wheels and steering may do
//! anything.

use vigil_blocks::WHEELS;
use vigil_inference::alternative::Alternative;
use vigil_robot::learned::SteerReading;
use vigil_robot::learned::wheel_evidence::ANYTHING;

/// Of each steered wheel: as commanded, or anything.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Angles([Alternative; WHEELS]);

impl Default for Angles {
    /// As the unknown begins.
    fn default() -> Self {
        Self([Alternative::new(ANYTHING); WHEELS])
    }
}

impl Angles {
    /// Takes the angles that were read, each of which begins or ceases to be as commanded with the
    /// probability `changes`; log-density over that of angles as commanded.
    pub fn step(&mut self, readings: &[Option<SteerReading>; WHEELS], changes: f64) -> f64 {
        let angles = self.0.iter_mut().zip(readings);
        let read = angles.filter_map(|(angle, reading)| Some((angle, reading.as_ref()?)));
        read.map(|(angle, reading)| angle.step(reading.log_ratio_any(), changes))
            .sum()
    }
}
