//! What the identifier says about one state of the decision model: that of hardware faults.
//!
//! The state's likelihood is the identifier's probability of any fault of its tree, divided by what
//! it predicted before the cycle's data; that of every other state is the same of the complement.
//! Quotients are summed, as logarithms, over an epoch. While the identifier watches, it says
//! nothing about faults, and there is no evidence. When it begins to identify, returns to watching
//! or names another mode, quotients mean little and its probability is taken over; the model's
//! start belief in the state is the least that is taken over. A posterior that the identifier
//! holds against a tracked belief that expects a fault to have been mended is taken over too:
//! clearing needs evidence.

use vigil_blocks::FaultBelief;
use vigil_decision::Pomdp;

/// One cycle can change the odds by this factor at most, as a logarithm.
const LOG_RATIO_MAX: f64 = 20.0;
/// An epoch can change them by this factor at most.
const LOG_EPOCH_MAX: f64 = 300.0;
/// The tracked belief may be below the identifier's by this much.
const DRIFT_MAX: f64 = 0.05;
/// A probability may exceed 1 by this much, for rounding.
const P_TOLERANCE: f64 = 1e-6;
/// Nothing is ever certain.
const P_MAX: f64 = 1.0 - 1e-6;

/// The state, and the evidence of the present epoch.
#[derive(Debug, Clone)]
pub(crate) struct Hardware {
    state: usize,
    p_start: f64,
    tree_hash: u64,
    /// Sums of logarithms: of the state, of the others.
    log: [f64; 2],
    before: Option<(u64, u32, u32)>,
    p: f64,
    identifies: bool,
}

impl Hardware {
    pub(crate) fn new(model: &Pomdp, state: usize, tree_hash: u64) -> Self {
        Self {
            state,
            p_start: model.start().get(state).copied().unwrap_or(0.0),
            tree_hash,
            log: [0.0; 2],
            before: None,
            p: 0.0,
            identifies: false,
        }
    }

    /// True if a diagnosis speaks of this tree and its probabilities are some.
    pub(crate) fn is_sound(&self, diagnosis: &FaultBelief) -> bool {
        let p = [
            diagnosis.p[0],
            diagnosis.p_unknown,
            diagnosis.p_predicted[0],
            diagnosis.p_unknown_predicted,
        ];
        let is_probability = |p: &f64| (0.0..=1.0 + P_TOLERANCE).contains(p);
        p.iter().all(is_probability) && diagnosis.tree_hash == self.tree_hash
    }

    /// Takes a diagnosis; true if the identifier's probability is to be taken over.
    pub(crate) fn add(&mut self, diagnosis: &FaultBelief) -> bool {
        let FaultBelief {
            identifying,
            mode_change_count,
            ..
        } = *diagnosis;
        let now = (diagnosis.header.epoch, identifying, mode_change_count);
        let before = self.before.replace(now);
        let p = faulty(diagnosis.p[0], diagnosis.p_unknown);
        let predicted = faulty(diagnosis.p_predicted[0], diagnosis.p_unknown_predicted);
        (self.p, self.identifies) = (p, identifying != 0);
        if before != Some(now) {
            self.clear();
            let identified = before.is_some_and(|(_, identified, _)| identified != 0);
            return self.identifies || identified;
        }
        if self.identifies {
            let ratios = [p / predicted, (1.0 - p) / (1.0 - predicted)];
            for (sum, ratio) in self.log.iter_mut().zip(ratios) {
                *sum = (*sum + log(ratio)).clamp(-LOG_EPOCH_MAX, LOG_EPOCH_MAX);
            }
        }
        false
    }

    /// Writes the likelihood of every state, the larger being 1, and begins anew.
    pub(crate) fn take(&mut self, likelihood: &mut [f64]) {
        let [state, others] = self.log;
        let max = state.max(others);
        likelihood.fill((others - max).exp());
        if let Some(l) = likelihood.get_mut(self.state) {
            *l = (state - max).exp();
        }
        self.clear();
    }

    /// True if `belief` expects a fault to be mended that the identifier still sees.
    pub(crate) fn has_drifted(&self, belief: &[f64]) -> bool {
        let tracked = belief.get(self.state).copied().unwrap_or(0.0);
        self.identifies && tracked < self.p - DRIFT_MAX
    }

    /// Writes `belief` with the identifier's probability of the state into `weights`.
    pub(crate) fn anchored(&self, belief: &[f64], start: &[f64], weights: &mut [f64]) {
        let p = self.p.clamp(self.p_start, P_MAX);
        let rest = |of: &[f64]| -> f64 {
            let others = of.iter().enumerate().filter(|(s, _)| *s != self.state);
            others.map(|(_, b)| b).sum()
        };
        // A belief in nothing else falls back to the start's.
        let of = if rest(belief) > 0.0 { belief } else { start };
        let others = rest(of);
        for (s, (weight, b)) in weights.iter_mut().zip(of).enumerate() {
            *weight = if s == self.state {
                p
            } else {
                (1.0 - p) * b / others
            };
        }
    }

    /// The next diagnosis begins anew.
    pub(crate) const fn forget(&mut self) {
        self.before = None;
        self.identifies = false;
        self.clear();
    }

    const fn clear(&mut self) {
        self.log = [0.0; 2];
    }
}

/// Probability of any fault of the tree.
fn faulty(p_nominal: f64, p_unknown: f64) -> f64 {
    (1.0 - p_nominal - p_unknown).clamp(0.0, 1.0)
}

/// Bounded; no evidence where the quotient has no meaning.
fn log(ratio: f64) -> f64 {
    if ratio.is_finite() && ratio >= 0.0 {
        ratio.ln().clamp(-LOG_RATIO_MAX, LOG_RATIO_MAX)
    } else {
        0.0
    }
}
