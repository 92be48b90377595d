//! Can the reported probabilities be believed?

use schemars::JsonSchema;
use serde::Serialize;

use super::{Case, JUDGED_S, Ratio, Taxonomy, Verdict};

/// Bins of the expected calibration error, of equal width.
const BINS: usize = 10;
/// A claim above this probability is confident.
const CONFIDENT_P: f64 = 0.9;
/// Probabilities below this count as this, so that one mistake does not make a mean infinite.
const P_MIN: f64 = 1e-6;

/// -ln p of what is true, nats: at most 13.8.
#[must_use]
pub fn log_score_nats(p_true: f64) -> f64 {
    -p_true.clamp(P_MIN, 1.0).ln()
}

/// Expected calibration error of claims, each a probability and whether it came true (Naeini,
/// Cooper and Hauskrecht 2015): mean over ten bins of equal width, 0 to 0.1 and so on, of
/// |fraction true - mean probability|, weighted by the claims in each. `None` without a claim.
#[must_use]
pub fn expected_calibration_error(claims: impl Iterator<Item = (f64, bool)>) -> Option<f64> {
    let (mut excess, mut n) = ([0.0_f64; BINS], 0_usize);
    for (p, is_true) in claims {
        excess[bin_of(p)] += f64::from(u8::from(is_true)) - p;
        n += 1;
    }
    (n > 0).then(|| excess.iter().map(|sum| sum.abs()).sum::<f64>() / n as f64)
}

/// The bin of a probability; 1 is in the last one.
fn bin_of(p: f64) -> usize {
    ((p * BINS as f64) as usize).min(BINS - 1)
}

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

    /// The claims in ten bins of equal width, 0 to 0.1 and so on, the last with 1; without those
    /// that are empty.
    #[must_use]
    pub fn bins(&self) -> Vec<Bin> {
        let mut bins = vec![Vec::new(); BINS];
        for &claim in &self.claims {
            bins[bin_of(claim.0)].push(claim);
        }
        bins.iter().filter_map(|bin| Bin::new(bin)).collect()
    }

    /// See [`expected_calibration_error`].
    #[must_use]
    pub fn expected_calibration_error(&self) -> Option<f64> {
        expected_calibration_error(self.claims.iter().copied())
    }

    /// Mean of (probability - 1 if true, 0 if not) squared. `None` without a claim.
    #[must_use]
    pub fn brier_score(&self) -> Option<f64> {
        let square = |&(p, is_true): &(f64, bool)| (p - f64::from(u8::from(is_true))).powi(2);
        let n = self.claims.len();
        (n > 0).then(|| self.claims.iter().map(square).sum::<f64>() / n as f64)
    }
}

/// Claims of like probability.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, JsonSchema)]
pub struct Bin {
    /// Number of claims.
    pub n: usize,
    /// Least probability claimed.
    pub p_min: f64,
    /// Mean probability claimed.
    pub p_mean: f64,
    /// Largest probability claimed.
    pub p_max: f64,
    /// Claims that were true.
    #[serde(rename = "true")]
    pub is_true: Ratio,
}

impl Bin {
    /// `None` without a claim.
    fn new(claims: &[(f64, bool)]) -> Option<Self> {
        let mut is_true = Ratio::default();
        claims.iter().for_each(|claim| is_true.add(claim.1));
        let p = || claims.iter().map(|claim| claim.0);
        Some(Self {
            n: claims.len(),
            p_min: p().reduce(f64::min)?,
            p_mean: p().sum::<f64>() / claims.len() as f64,
            p_max: p().reduce(f64::max)?,
            is_true,
        })
    }
}

/// What a verdict was worth.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct VerdictScore {
    /// The mode named is the true one, or an abstract node above it.
    pub is_true: bool,
    /// -ln p(true mode), nats.
    pub log_score_nats: f64,
    /// Something false was said with more than 0.9.
    pub is_confident_wrong: bool,
}

/// Judges a verdict when `truth` is true.
pub(super) fn judge(verdict: &Verdict, truth: &str, taxonomy: &Taxonomy) -> VerdictScore {
    let is_true = taxonomy.covers(&verdict.mode, truth);
    let p = match taxonomy.index(truth) {
        Some(index) => verdict.belief().node(index, taxonomy),
        None => verdict.belief().unknown(taxonomy),
    };
    VerdictScore {
        is_true,
        log_score_nats: log_score_nats(p),
        is_confident_wrong: !is_true && verdict.p_mode > CONFIDENT_P,
    }
}

/// Calibration of the reported modes 2 s after the onset of the faults of one class.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct Calibration {
    /// Number of runs.
    pub n: usize,
    /// Expected calibration error of `p_mode` in ten bins of equal width. An abstract node above
    /// the true leaf is true.
    pub expected_calibration_error: Option<f64>,
    /// Mean squared error of `p_mode` as the probability that the name is true.
    pub brier_score: Option<f64>,
    /// The bins of the calibration error.
    pub reliability: Vec<Bin>,
    /// Mean of -ln p(true mode), nats; p is that of unknown if the tree lacks the mode, and at
    /// least 1e-6.
    pub log_score_nats: Option<f64>,
    /// Runs in which something false was reported with more than 0.9 (`right` counts them).
    pub confident_wrong: Ratio,
}

impl Calibration {
    pub(super) fn new(cases: &[&Case], taxonomy: &Taxonomy) -> Self {
        let (mut claims, mut log_score) = (Claims::default(), 0.0);
        let mut confident_wrong = Ratio::default();
        for case in cases {
            let Some(verdict) = case.at(JUDGED_S) else {
                continue;
            };
            let judged = judge(verdict, &case.label.mode, taxonomy);
            claims.add(verdict.p_mode, judged.is_true);
            log_score += judged.log_score_nats;
            confident_wrong.add(judged.is_confident_wrong);
        }
        let n = claims.claims.len();
        Self {
            n,
            expected_calibration_error: claims.expected_calibration_error(),
            brier_score: claims.brier_score(),
            reliability: claims.bins(),
            log_score_nats: (n > 0).then(|| log_score / n as f64),
            confident_wrong,
        }
    }
}
