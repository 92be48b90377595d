//! How often the faults of the leaves come and go.

use vigil_robot::FaultPrior;
use vigil_robot::learned::FaultRates;

use crate::identify::leaf_map::LeafMap;

/// Rates of each leaf's fault and of the unknown, while something is suspected.
pub fn fault_rates(prior: &FaultPrior, leaves: &LeafMap, p_unknown: f64) -> FaultRates {
    let first_1_s = prior.suspected_1_s;
    FaultRates {
        fault_1_s: first_1_s * (1.0 - p_unknown) / leaves.count.max(1) as f64,
        unknown_1_s: first_1_s * p_unknown,
        further: (prior.further_1_s / first_1_s).min(1.0),
        death_1_s: prior.mended_1_s,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_first_fault_is_shared_by_leaves_and_unknown() {
        let prior = FaultPrior {
            suspected_1_s: 0.02,
            further_1_s: 0.005,
            mended_1_s: 0.003,
            again_1_s: 0.1,
        };
        let mut leaves = LeafMap::none();
        leaves.count = 4;
        let rates = fault_rates(&prior, &leaves, 0.25);
        let expected = [0.02 * 0.75 / 4.0, 0.02 * 0.25, 0.25, 0.003];
        let found = [
            rates.fault_1_s,
            rates.unknown_1_s,
            rates.further,
            rates.death_1_s,
        ];
        for (found, expected) in found.into_iter().zip(expected) {
            assert!((found - expected).abs() < 1e-15, "{found}, not {expected}");
        }
        let often = FaultPrior {
            further_1_s: 1.0,
            ..prior
        };
        assert_eq!(fault_rates(&often, &leaves, 0.25).further, 1.0);
    }
}
