//! Exact belief over sets of faults: several at once, coming and going.
//!
//! K components, each broken or not, make 2^K sets. Every component breaks and heals by itself,
//! with its own probabilities per step, so the prediction factors: for each component j and every
//! pair of sets that differ in it, `n0 = (1 - a) p0 + r p1`, `n1 = a p0 + (1 - r) p1`. The update
//! multiplies by the likelihood of each set. For wheels the likelihood factors too: the stuck
//! wheels move the body, and each wheel's reading depends on whether it is stuck and whether its
//! encoder is broken. [`FaultSets::update_wheels`] builds all 2^K products by doubling, without an
//! exponential per set.
//!
//! Nothing is pruned: with 12 components the whole update takes a few tens of microseconds.

/// Components that a belief can have: 65536 sets.
pub const COMPONENTS_MAX: usize = 16;
/// Least probability of a set: no set is lost for good, and no number becomes subnormal.
const FLOOR: f64 = 1e-290;

/// How one component breaks and heals, per step.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Component {
    /// Probability that it is broken before the first step.
    pub prior: f64,
    /// Probability that it breaks in a step.
    pub birth: f64,
    /// Probability that it heals in a step.
    pub death: f64,
}

/// Why a belief over sets was refused.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum FaultSetsError {
    /// Too many components, or none.
    #[error("{0} components: allowed are 1 to {COMPONENTS_MAX}")]
    Count(usize),
    /// Not a probability.
    #[error("component {component}: {quantity} is {found}: allowed is 0 to 1")]
    Probability {
        /// Index of the component.
        component: usize,
        /// `prior`, `birth` or `death`.
        quantity: &'static str,
        /// Its value.
        found: f64,
    },
}

/// The belief over all sets of faults; bit j of a set says that component j is broken.
#[derive(Debug, Clone, PartialEq)]
pub struct FaultSets {
    components: Vec<Component>,
    p: Vec<f64>,
    likelihood: Vec<f64>,
    factor: Vec<f64>,
}

impl FaultSets {
    /// The belief before the first step. Allocates all that it will ever need.
    ///
    /// # Errors
    /// [`FaultSetsError`] naming the component.
    pub fn new(components: &[Component]) -> Result<Self, FaultSetsError> {
        if components.is_empty() || components.len() > COMPONENTS_MAX {
            return Err(FaultSetsError::Count(components.len()));
        }
        for (component, c) in components.iter().enumerate() {
            let named = [("prior", c.prior), ("birth", c.birth), ("death", c.death)];
            for (quantity, found) in named {
                if !(0.0..=1.0).contains(&found) {
                    return Err(FaultSetsError::Probability {
                        component,
                        quantity,
                        found,
                    });
                }
            }
        }
        let sets = 1 << components.len();
        let mut belief = Self {
            components: components.to_vec(),
            p: vec![0.0; sets],
            likelihood: vec![0.0; sets],
            factor: vec![0.0; sets],
        };
        belief.reset();
        Ok(belief)
    }

    /// Forgets everything seen.
    pub fn reset(&mut self) {
        for (set, p) in self.p.iter_mut().enumerate() {
            let share = |(j, c): (usize, &Component)| match set >> j & 1 {
                0 => 1.0 - c.prior,
                _ => c.prior,
            };
            *p = self.components.iter().enumerate().map(share).product();
        }
    }

    /// One step: components break and heal.
    pub fn predict(&mut self) {
        for (j, component) in self.components.iter().enumerate() {
            let Component { birth, death, .. } = *component;
            let half = 1 << j;
            for pair in self.p.chunks_exact_mut(2 * half) {
                let (whole, broken) = pair.split_at_mut(half);
                for (p0, p1) in whole.iter_mut().zip(broken) {
                    let (before0, before1) = (*p0, *p1);
                    *p0 = (1.0 - birth) * before0 + death * before1;
                    *p1 = birth * before0 + (1.0 - death) * before1;
                }
            }
        }
    }

    /// Multiplies by `exp(log_likelihood(set))`; returns the log-evidence. None, unchanged, when
    /// every set is impossible. What is not a number counts as impossible.
    pub fn update(&mut self, mut log_likelihood: impl FnMut(u32) -> f64) -> Option<f64> {
        let mut highest = f64::NEG_INFINITY;
        for (set, value) in self.likelihood.iter_mut().enumerate() {
            *value = log_likelihood(set as u32);
            highest = highest.max(*value);
        }
        if !highest.is_finite() {
            return None;
        }
        for value in &mut self.likelihood {
            let shifted = (*value - highest).exp();
            *value = if shifted.is_nan() { 0.0 } else { shifted };
        }
        self.multiply(highest)
    }

    /// The update for W wheels: component w is wheel w stuck, component W + w its encoder broken.
    /// `body[mask]` is the log-likelihood of the pose for each of the 2^W sets of stuck wheels,
    /// `wheels[w][stuck + 2 broken]` that of wheel w's reading. Equal to [`Self::update`] with
    /// their sum. None, unchanged, when every set is impossible, a value is not a number, or the
    /// tables do not fit the components.
    pub fn update_wheels(&mut self, body: &[f64], wheels: &[[f64; 4]]) -> Option<f64> {
        let count = wheels.len();
        let sets = 1_usize << count;
        if self.components.len() != 2 * count || body.len() != sets {
            return None;
        }
        let values = || body.iter().chain(wheels.iter().flatten());
        if values().any(|value| value.is_nan() || *value == f64::INFINITY) {
            return None;
        }
        let highest_of = |values: &[f64]| values.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        let highest = highest_of(body);
        let mut shift = highest;
        for (value, log_likelihood) in self.likelihood.iter_mut().zip(body) {
            *value = (log_likelihood - highest).exp();
        }
        for (w, table) in wheels.iter().enumerate() {
            let highest = highest_of(table);
            shift += highest;
            let table = table.map(|value| (value - highest).exp());
            // Factors of this wheel for each set of stuck wheels: encoder whole, then broken.
            let (whole, broken) = self.factor[..2 * sets].split_at_mut(sets);
            for (mask, (whole, broken)) in whole.iter_mut().zip(broken.iter_mut()).enumerate() {
                let stuck = mask >> w & 1;
                (*whole, *broken) = (table[stuck], table[stuck + 2]);
            }
            // The sets with this encoder broken follow those in which it is whole.
            let rows = sets << w;
            let (done, next) = self.likelihood[..2 * rows].split_at_mut(rows);
            let pairs = done.chunks_exact_mut(sets).zip(next.chunks_exact_mut(sets));
            for (done, next) in pairs {
                for i in 0..sets {
                    next[i] = done[i] * broken[i];
                    done[i] *= whole[i];
                }
            }
        }
        if !shift.is_finite() {
            return None;
        }
        self.multiply(shift)
    }

    /// Multiplies by the shifted likelihoods and normalises.
    fn multiply(&mut self, shift: f64) -> Option<f64> {
        let total: f64 = self
            .p
            .iter()
            .zip(&self.likelihood)
            .map(|(p, l)| p * l)
            .sum();
        if !(total.is_finite() && total > 0.0) {
            return None;
        }
        for (p, likelihood) in self.p.iter_mut().zip(&self.likelihood) {
            *p = *p * likelihood / total + FLOOR;
        }
        Some(shift + total.ln())
    }

    /// Probability of exactly this set.
    #[must_use]
    pub fn probability(&self, set: u32) -> f64 {
        self.p.get(set as usize).copied().unwrap_or(0.0)
    }

    /// Probabilities of all sets, by their bits; the sum is 1.
    #[must_use]
    pub fn probabilities(&self) -> &[f64] {
        &self.p
    }

    /// Probability that component `j` is broken, whatever else is.
    #[must_use]
    pub fn marginal(&self, j: usize) -> f64 {
        self.any(1_u32.checked_shl(j as u32).unwrap_or(0))
    }

    /// Probability that any component of `mask` is broken.
    #[must_use]
    pub fn any(&self, mask: u32) -> f64 {
        let sets = self.p.iter().enumerate();
        sets.filter(|(set, _)| *set as u32 & mask != 0)
            .map(|(_, p)| p)
            .sum()
    }

    /// Fills `sets` with the most probable ones and their probabilities, the most probable first.
    /// Places beyond the number of sets get the probability 0.
    pub fn most_probable(&self, sets: &mut [(u32, f64)]) {
        sets.fill((0, 0.0));
        for (set, &p) in self.p.iter().enumerate() {
            let Some(last) = sets.last() else { return };
            if p > last.1 {
                let at = sets.partition_point(|(_, other)| *other >= p);
                sets[at..].rotate_right(1);
                sets[at] = (set as u32, p);
            }
        }
    }

    /// Entropy over sets, nat.
    #[must_use]
    pub fn entropy(&self) -> f64 {
        -self
            .p
            .iter()
            .filter(|p| **p > 0.0)
            .map(|p| p * p.ln())
            .sum::<f64>()
    }
}
