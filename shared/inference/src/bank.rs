//! A bounded set of weighted hypotheses: one per mode and onset, each with its own continuous
//! state.
//!
//! The posterior over modes is the sum of the hypotheses' weights: no sampling, no mixing. The set
//! is bounded: improbable hypotheses are dropped, and when a mode's places are taken its least
//! probable hypothesis gives way.

use vigil_checkpoint::{Checkpoint, CheckpointValue};

use crate::logspace::{log_add, log_sum_exp};

/// One hypothesis: since `onset` the system is in `mode`.
#[derive(Debug, Clone, Copy, PartialEq, CheckpointValue)]
#[checkpoint(bound = "T: CheckpointValue")]
pub struct Hypothesis<T> {
    /// Mode, a caller's index.
    pub mode: usize,
    /// Onset, a caller's time.
    pub onset: u64,
    /// Logarithm of the normalised weight.
    pub log_weight: f64,
    /// Continuous state under this hypothesis.
    pub state: T,
}

/// A bounded set of hypotheses.
#[derive(Debug, Clone, Checkpoint)]
#[checkpoint(bound = "T: CheckpointValue")]
pub struct Bank<T> {
    hypotheses: Vec<Hypothesis<T>>,
    #[checkpoint(scratch)]
    scratch: Vec<f64>,
    #[checkpoint(fixed)]
    capacities: Vec<usize>,
    /// Most hypotheses in all.
    #[checkpoint(fixed)]
    places: usize,
    limit: usize,
}

impl<T: Copy> Bank<T> {
    /// An empty bank of at most `capacities[mode]` hypotheses for each mode. Allocates once.
    #[must_use]
    pub fn new(capacities: &[usize]) -> Self {
        // At least that of the hypothesis which `restart` begins with.
        let places = capacities.iter().sum::<usize>().max(1);
        Self {
            hypotheses: Vec::with_capacity(places),
            scratch: Vec::with_capacity(places),
            capacities: capacities.to_vec(),
            places,
            limit: usize::MAX,
        }
    }

    /// Most hypotheses that a normalisation leaves.
    #[must_use]
    pub fn limit(&self) -> usize {
        self.limit.min(self.places)
    }

    /// Keeps only the `count` most probable hypotheses, at least one, from the next normalisation
    /// on.
    pub fn set_limit(&mut self, count: usize) {
        self.limit = count.max(1);
    }

    /// Forgets everything and starts from one hypothesis.
    pub fn restart(&mut self, mode: usize, onset: u64, state: T) {
        self.hypotheses.clear();
        self.hypotheses.push(Hypothesis {
            mode,
            onset,
            log_weight: 0.0,
            state,
        });
    }

    /// The hypotheses.
    #[must_use]
    pub fn hypotheses(&self) -> &[Hypothesis<T>] {
        &self.hypotheses
    }

    /// The hypotheses, for the caller's prediction and update.
    pub fn hypotheses_mut(&mut self) -> &mut [Hypothesis<T>] {
        &mut self.hypotheses
    }

    /// The most probable hypothesis among those of `wanted` modes.
    #[must_use]
    pub fn best(&self, wanted: impl Fn(usize) -> bool) -> Option<&Hypothesis<T>> {
        self.hypotheses
            .iter()
            .filter(|hypothesis| wanted(hypothesis.mode))
            .max_by(|a, b| a.log_weight.total_cmp(&b.log_weight))
    }

    /// Adds a hypothesis. A mode whose places are taken gives up its least probable one; a mode
    /// without places takes none.
    pub fn add(&mut self, hypothesis: Hypothesis<T>) {
        let mode = hypothesis.mode;
        let is_alike = |other: &Hypothesis<T>| other.mode == mode;
        let taken = self.hypotheses.iter().filter(|other| is_alike(other));
        let capacity = self.capacities.get(mode).copied().unwrap_or(0);
        // The caller may have moved hypotheses to other modes: the sum is bounded on its own.
        if taken.count() < capacity && self.hypotheses.len() < self.places {
            self.hypotheses.push(hypothesis);
            return;
        }
        let alike = self.hypotheses.iter_mut().filter(|other| is_alike(other));
        let least = alike.min_by(|a, b| a.log_weight.total_cmp(&b.log_weight));
        if let Some(least) = least {
            *least = hypothesis;
        }
    }

    /// Normalises, drops hypotheses whose log-weight is below `floor`, or not a number, and keeps
    /// as many as the limit allows. Returns the logarithm of the sum before, or None, unchanged, if
    /// nothing is possible.
    pub fn normalise(&mut self, floor: f64) -> Option<f64> {
        assert!(
            self.hypotheses.len() <= self.places,
            "a bank holds no more hypotheses than it has places"
        );
        self.scratch.clear();
        for hypothesis in &mut self.hypotheses {
            if hypothesis.log_weight.is_nan() {
                hypothesis.log_weight = f64::NEG_INFINITY;
            }
            self.scratch.push(hypothesis.log_weight);
        }
        let evidence = log_sum_exp(&self.scratch);
        if !evidence.is_finite() {
            return None;
        }
        self.hypotheses.retain_mut(|hypothesis| {
            hypothesis.log_weight -= evidence;
            hypothesis.log_weight >= floor
        });
        self.keep();
        Some(evidence)
    }

    /// Keeps the most probable hypotheses up to the limit, in their order; of equally probable ones
    /// the first. The weight of the others is shared out by the next normalisation.
    fn keep(&mut self) {
        let count = self.limit;
        if self.hypotheses.len() <= count {
            return;
        }
        self.scratch.clear();
        let weights = self.hypotheses.iter().map(|other| other.log_weight);
        self.scratch.extend(weights);
        let (_, &mut least, _) = self
            .scratch
            .select_nth_unstable_by(count - 1, |a, b| b.total_cmp(a));
        let is_above = |weight: f64| weight.total_cmp(&least).is_gt();
        let above = self.scratch.iter().filter(|&&weight| is_above(weight));
        let mut equal = count - above.count();
        self.hypotheses.retain(|other| {
            let is_equal = other.log_weight.total_cmp(&least).is_eq() && equal > 0;
            equal -= usize::from(is_equal);
            is_equal || is_above(other.log_weight)
        });
    }

    /// Fills `log_p[mode]` with the logarithm of each mode's weight, minus infinity where there is
    /// none.
    pub fn modes(&self, log_p: &mut [f64]) {
        log_p.fill(f64::NEG_INFINITY);
        for hypothesis in &self.hypotheses {
            let p = &mut log_p[hypothesis.mode];
            *p = log_add(*p, hypothesis.log_weight);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn hypothesis(mode: usize, onset: u64, p: f64) -> Hypothesis<()> {
        Hypothesis {
            mode,
            onset,
            log_weight: p.ln(),
            state: (),
        }
    }

    #[test]
    fn weights_add_up_per_mode() {
        let mut bank = Bank::new(&[4; 3]);
        bank.restart(0, 0, ());
        bank.add(hypothesis(1, 1, 0.5));
        bank.add(hypothesis(1, 2, 0.5));
        let evidence = bank.normalise(-30.0).unwrap();
        assert!((evidence - 2.0_f64.ln()).abs() < 1e-12);
        let mut log_p = [0.0; 3];
        bank.modes(&mut log_p);
        assert!((log_p[0].exp() - 0.5).abs() < 1e-12 && (log_p[1].exp() - 0.5).abs() < 1e-12);
        assert_eq!(log_p[2], f64::NEG_INFINITY);
        assert_eq!(bank.best(|mode| mode == 1).map(|best| best.mode), Some(1));
    }

    #[test]
    fn the_unlikely_are_dropped_and_the_bank_stays_bounded() {
        let mut bank = Bank::new(&[3; 2]);
        bank.restart(0, 0, ());
        for onset in 0..50 {
            bank.add(hypothesis(1, onset, 1e-3));
        }
        assert_eq!(bank.hypotheses().len(), 4);
        bank.add(hypothesis(1, 99, 1e-30));
        bank.normalise(-30.0).unwrap();
        assert!(bank.hypotheses().iter().all(|other| other.onset != 99));
    }

    #[test]
    fn a_limit_keeps_the_most_probable_in_their_order() {
        let mut bank = Bank::new(&[8; 2]);
        bank.restart(0, 0, ());
        for (onset, p) in (1..).zip([0.1, 0.3, 0.2, 0.1, 0.3, 0.05]) {
            bank.add(hypothesis(1, onset, p));
        }
        let onsets = |bank: &Bank<()>| -> Vec<u64> {
            let all = bank.hypotheses().iter();
            all.map(|hypothesis| hypothesis.onset).collect()
        };
        let mut keep = |count: usize| {
            bank.set_limit(count);
            bank.normalise(-30.0).unwrap();
            onsets(&bank)
        };
        assert_eq!(keep(7), [0, 1, 2, 3, 4, 5, 6]);
        // Of two that are equally probable, the first.
        assert_eq!(keep(5), [0, 1, 2, 3, 5]);
        assert_eq!(keep(2), [0, 2]);
        assert_eq!(keep(0), [0]);
        assert_eq!(bank.limit(), 1);
        bank.set_limit(usize::MAX);
        assert_eq!(bank.limit(), 16);
    }

    #[test]
    #[should_panic(expected = "a bank holds no more hypotheses than it has places")]
    fn more_hypotheses_than_places_are_caught() {
        let mut bank = Bank::new(&[1, 1]);
        bank.restart(0, 0, ());
        for onset in 1..3 {
            bank.hypotheses.push(hypothesis(1, onset, 0.5));
        }
        bank.normalise(-30.0);
    }

    #[test]
    fn a_full_mode_gives_up_its_least_probable_and_a_mode_without_places_takes_none() {
        let mut bank = Bank::new(&[1, 2]);
        bank.restart(0, 0, ());
        for (onset, p) in [(1, 0.5), (2, 0.1), (3, 0.3)] {
            bank.add(hypothesis(1, onset, p));
        }
        bank.add(hypothesis(2, 4, 0.9));
        let onsets = |bank: &Bank<()>| -> Vec<u64> {
            bank.hypotheses().iter().map(|other| other.onset).collect()
        };
        assert_eq!(onsets(&bank), [0, 1, 3]);
        // Moved by the caller: mode 1 has room, the bank has none.
        bank.hypotheses_mut()[1].mode = 0;
        bank.add(hypothesis(1, 5, 0.2));
        assert_eq!(onsets(&bank), [0, 1, 5]);
        bank.normalise(-30.0).unwrap();
    }

    #[test]
    fn a_hypothesis_at_the_floor_stays_and_one_below_it_goes() {
        let mut bank = Bank::new(&[1, 2]);
        bank.restart(0, 0, ());
        bank.add(Hypothesis {
            log_weight: f64::NEG_INFINITY,
            ..hypothesis(1, 1, 1.0)
        });
        bank.normalise(0.0).unwrap();
        assert_eq!(bank.hypotheses().len(), 1);
        assert_eq!(bank.hypotheses()[0].log_weight, 0.0);
    }

    #[test]
    fn impossible_weights_leave_the_bank_as_it_is() {
        let mut bank = Bank::new(&[2]);
        bank.restart(0, 0, ());
        bank.hypotheses_mut()[0].log_weight = f64::NAN;
        assert_eq!(bank.normalise(-30.0), None);
    }
}
