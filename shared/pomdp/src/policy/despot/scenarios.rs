//! Weighted scenarios of a belief: all of its states, or a sample of them.

use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;

use crate::fnv1a;
use crate::weights::Weights;

/// A state, and its weight.
pub(super) type Scenario = (u32, f64);

/// Chooses scenarios; of a belief with more states than scenarios it takes a sample.
#[derive(Debug, Clone)]
pub(super) struct Sampler {
    count: usize,
    seed: u64,
    rng: Pcg64Mcg,
}

impl Sampler {
    /// For so many scenarios of each belief.
    pub(super) fn new(count: usize, seed: u64) -> Self {
        Self {
            count,
            seed,
            rng: Pcg64Mcg::seed_from_u64(seed),
        }
    }

    /// Begins anew: what follows depends on the seed and on `belief` alone.
    pub(super) fn begin(&mut self, belief: &Weights) {
        let hash = belief.support().iter().fold(self.seed, |hash, &state| {
            let hash = fnv1a::hash_u64(hash, u64::from(state));
            fnv1a::hash_u64(hash, belief.at(state).to_bits())
        });
        self.rng = Pcg64Mcg::seed_from_u64(hash);
    }

    /// Adds the scenarios of `belief`: each of its states with its weight if there are few enough,
    /// else a systematic sample, each with an equal part of the weight.
    pub(super) fn draw(&mut self, belief: &Weights, scenarios: &mut Vec<Scenario>) {
        let states = belief.support().iter();
        let weighted = states.map(|&state| (state, belief.at(state)));
        if belief.support().len() <= self.count {
            return scenarios.extend(weighted);
        }
        let part = belief.sum() / self.count as f64;
        let offset: f64 = self.rng.random();
        let (mut passed, mut taken) = (0.0, 0);
        for (state, weight) in weighted {
            passed += weight;
            // Of the points offset, offset + 1, ... those up to here.
            let due = ((passed / part + 1.0 - offset) as usize).min(self.count);
            if due > taken {
                scenarios.push((state, (due - taken) as f64 * part));
                taken = due;
            }
        }
    }
}
