//! Which steering angles are as commanded, in the unknown where wheels and steering may do
//! anything.

use vigil_blocks::WHEELS;
use vigil_checkpoint::CheckpointValue;
use vigil_inference::alternative::Alternatives;
use vigil_robot::learned::SteerReading;
use vigil_robot::learned::steer_reading::ANYTHING;

/// Of each steered wheel: as commanded, or anything.
#[derive(Debug, Clone, Copy, PartialEq, CheckpointValue)]
pub struct Angles([Alternatives<2>; WHEELS]);

impl Default for Angles {
    /// As the unknown begins.
    fn default() -> Self {
        Self([Alternatives::new([1.0 - ANYTHING, ANYTHING]); WHEELS])
    }
}

impl Angles {
    /// Takes the angles that were read, each of which begins or ceases to be as commanded with the
    /// probability `changes`; log-density over that of angles as commanded.
    pub fn step(&mut self, readings: &[Option<SteerReading>; WHEELS], changes: f64) -> f64 {
        let read = readings.iter().enumerate();
        let read = read.filter_map(|(wheel, reading)| Some((wheel, reading.as_ref()?)));
        read.map(|(wheel, reading)| self.step_one(wheel, reading, changes))
            .sum()
    }

    /// The same of one wheel's angle.
    pub fn step_one(&mut self, wheel: usize, reading: &SteerReading, changes: f64) -> f64 {
        self.0[wheel].step([0.0, reading.log_ratio_any()], [changes; 2])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn without_a_reading_nothing_is_learned() {
        let mut angles = Angles::default();
        assert_eq!(angles.step(&[None; WHEELS], 0.1), 0.0);
        assert_eq!(angles, Angles::default());
    }
}
