//! How often faults come and go while something is suspected.

use vigil_robot::learned::FaultRates;

use crate::modes::Leaves;

/// Prior rate of faults while something is suspected, 1/s of motion. An alarm has been raised:
/// the rate over a robot's life would make the filter slow without making it more often right.
pub const BIRTH_1_S: f64 = 0.01;
/// Rate at which faults vanish, 1/s of motion.
pub const DEATH_1_S: f64 = 1.0 / 60.0;

/// Rates at which the leaves' faults come and go.
pub fn fault_rates(leaves: &Leaves, p_unknown: f64) -> FaultRates {
    FaultRates {
        fault_1_s: BIRTH_1_S * (1.0 - p_unknown) / leaves.count.max(1) as f64,
        unknown_1_s: BIRTH_1_S * p_unknown,
        death_1_s: DEATH_1_S,
    }
}
