//! Can the reported probabilities be believed?

use serde::Serialize;

use super::{Case, JUDGED_S, Ratio, Taxonomy};

/// Bins of the expected calibration error.
const BINS: usize = 15;
/// A claim above this probability is confident.
const CONFIDENT_P: f64 = 0.9;
/// Probabilities below this count as this, so that one mistake does not make a mean infinite.
const P_MIN: f64 = 1e-12;

/// Claims: a mode was reported with a probability, and it was true or not.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Claims {
    claims: Vec<(f64, bool)>,
}

impl Claims {
    /// Adds a claim.
    pub fn add(&mut self, p: f64, is_true: bool) {
        self.claims.push((p, is_true));
    }

    /// Expected calibration error: mean over bins of equally many claims (in order of their
    /// probability, 15 bins, fewer if there are fewer claims) of |fraction true - mean
    /// probability|, weighted by the claims in each. `None` without a claim.
    #[must_use]
    pub fn expected_calibration_error(&self) -> Option<f64> {
        let mut sorted = self.claims.clone();
        sorted.sort_by(|a, b| a.0.total_cmp(&b.0));
        let n = sorted.len();
        let bins = BINS.min(n);
        let mut error = 0.0;
        for bin in 0..bins {
            let of = &sorted[bin * n / bins..(bin + 1) * n / bins];
            let claimed: f64 = of.iter().map(|claim| claim.0).sum();
            let was_true = of.iter().filter(|claim| claim.1).count() as f64;
            error += (was_true - claimed).abs();
        }
        (n > 0).then(|| error / n as f64)
    }
}

/// Calibration of the reported modes 2 s after the onset of the faults of one class.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Calibration {
    /// Runs.
    pub n: usize,
    /// Expected calibration error of `p_mode` (15 bins of equally many runs). An abstract node
    /// above the true leaf is true.
    pub expected_calibration_error: Option<f64>,
    /// Mean of -ln p(true mode), nats; the probability of unknown if the tree lacks the mode.
    pub log_score_nats: Option<f64>,
    /// Runs in which something false was reported with more than 0.9 (`right` counts them).
    pub confident_wrong: Ratio,
}

impl Calibration {
    pub(super) fn of(cases: &[&Case], taxonomy: &Taxonomy) -> Self {
        let (mut claims, mut log_score) = (Claims::default(), 0.0);
        let mut confident_wrong = Ratio::default();
        for case in cases {
            let Some(verdict) = case.at(JUDGED_S) else {
                continue;
            };
            let truth = &case.label.mode;
            let is_true = taxonomy.covers(&verdict.mode, truth);
            claims.add(verdict.p_mode, is_true);
            let p = match taxonomy.index(truth) {
                Some(index) => verdict.p_nodes.get(index).copied().unwrap_or(0.0),
                None => verdict.p_unknown,
            };
            log_score -= p.clamp(P_MIN, 1.0).ln();
            confident_wrong.add(!is_true && verdict.p_mode > CONFIDENT_P);
        }
        let n = claims.claims.len();
        Self {
            n,
            expected_calibration_error: claims.expected_calibration_error(),
            log_score_nats: (n > 0).then(|| log_score / n as f64),
            confident_wrong,
        }
    }
}
