//! The exact forward filter of a hidden Markov model with N states.

use vigil_inference::logspace::log_sum_exp;

/// Belief over N states as logarithms of normalised probabilities.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Forward<const N: usize> {
    log_p: [f64; N],
}

impl<const N: usize> Forward<N> {
    /// All mass on `state`.
    #[must_use]
    pub fn at(state: usize) -> Self {
        let mut log_p = [f64::NEG_INFINITY; N];
        log_p[state] = 0.0;
        Self { log_p }
    }

    /// Logarithms of the normalised probabilities.
    #[must_use]
    pub const fn log_p(&self) -> &[f64; N] {
        &self.log_p
    }

    /// `b'_j = Σ_i b_i P_ij`.
    pub fn predict(&mut self, transition: &[[f64; N]; N]) {
        let before = self.log_p.map(f64::exp);
        for (j, log_p) in self.log_p.iter_mut().enumerate() {
            *log_p = (0..N)
                .map(|i| before[i] * transition[i][j])
                .sum::<f64>()
                .ln();
        }
    }

    /// Multiplies by the likelihoods and normalises; returns the log-evidence. None, unchanged,
    /// when every state is impossible or a value is not a number.
    pub fn update(&mut self, log_likelihood: &[f64; N]) -> Option<f64> {
        let mut posterior = self.log_p;
        for (log_p, log_l) in posterior.iter_mut().zip(log_likelihood) {
            *log_p += log_l;
        }
        let evidence = log_sum_exp(&posterior);
        if !evidence.is_finite() || posterior.iter().any(|log_p| log_p.is_nan()) {
            return None;
        }
        self.log_p = posterior.map(|log_p| log_p - evidence);
        Some(evidence)
    }
}

#[test]
fn impossible_evidence_changes_nothing() {
    let mut filter = Forward::<2>::at(0);
    for bad in [[f64::NEG_INFINITY; 2], [f64::NAN, 0.0]] {
        assert!(filter.update(&bad).is_none());
        assert_eq!(filter, Forward::at(0));
    }
}
