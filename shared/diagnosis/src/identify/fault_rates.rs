//! How often the faults of the leaves come and go.

use vigil_robot::FaultPrior;
use vigil_robot::learned::FaultRates;

use crate::identify::modes::Leaves;

/// Rates of each leaf's fault and of the unknown, while something is suspected.
pub fn fault_rates(prior: &FaultPrior, leaves: &Leaves, p_unknown: f64) -> FaultRates {
    let first_1_s = prior.suspected_1_s;
    FaultRates {
        fault_1_s: first_1_s * (1.0 - p_unknown) / leaves.count.max(1) as f64,
        unknown_1_s: first_1_s * p_unknown,
        further: (prior.further_1_s / first_1_s).min(1.0),
        death_1_s: prior.mended_1_s,
    }
}
