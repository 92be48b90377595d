//! Proposals: from which distribution a particle draws its next mode.
//!
//! A filter may draw the next mode from any `q(d' | d)` that is positive wherever `P` is, if it
//! multiplies the weight by `P / q` (importance sampling). Raising the probability of rare faults
//! in `q` puts particles where they will be needed.
//!
//! The risk-sensitive filter (Thrun, Langford and Verma, *Risk Sensitive Particle Filters*, 2001)
//! tracks `r(d) p(d, c | z)`, so that modes in which a lost track is expensive keep their
//! particles. Weights get the factor `r(d') / r(d)`; the reported belief is without this tilt,
//! each weight divided by its particle's risk.

use vigil_checkpoint::CheckpointValue;

use crate::filter::SUM_TOLERANCE;
use crate::hybrid::{self, ModelError, Modes};

/// Tables of a proposal for a fixed set of modes.
#[derive(Debug, Clone, PartialEq, CheckpointValue)]
pub struct Proposal {
    modes: usize,
    /// Row d: cumulative `q(. | d)`.
    cumulative: Vec<f64>,
    /// Row d: `ln(P / q) + ln(r(d') / r(d))`.
    correction: Vec<f64>,
    log_risk: Vec<f64>,
}

/// Why a proposal was refused.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum ProposalError {
    /// The model is refused.
    #[error(transparent)]
    Model(#[from] ModelError),
    /// One number per mode is needed.
    #[error("{found} numbers for {modes} modes")]
    Length {
        /// Numbers given.
        found: usize,
        /// Modes of the model.
        modes: usize,
    },
    /// A risk is not positive and finite.
    #[error("the risk of mode {mode} is {found}: allowed is any finite number above 0")]
    Risk {
        /// Index of the mode.
        mode: usize,
        /// Its risk.
        found: f64,
    },
    /// A probability of leaving is out of range.
    #[error("the share {0} is out of range: allowed is above 0 and below 1")]
    Share(f64),
    /// The risks are too large to be added up.
    #[error("the risks add up to no finite number")]
    Sum,
}

impl Proposal {
    /// The model's own transitions: the bootstrap filter.
    ///
    /// # Errors
    /// [`ProposalError::Model`].
    pub fn prior(model: &impl Modes) -> Result<Self, ProposalError> {
        hybrid::check(model)?;
        let risk = vec![1.0; model.modes()];
        Self::build(model, |from, to| model.transition(from, to), &risk)
    }

    /// From each mode a share `leave` of the draws goes to the other modes that the model can
    /// reach, in equal parts; the rest stays as the model has it.
    ///
    /// # Errors
    /// [`ProposalError`].
    pub fn raised(model: &impl Modes, leave: f64) -> Result<Self, ProposalError> {
        let risk = vec![1.0; model.modes()];
        Self::risk_raised(model, leave, &risk)
    }

    /// A share `leave` of the draws goes to other modes, in proportion to their risks, and the
    /// belief is tracked tilted by the risk. Where risks differ by less than faults are rare, the
    /// risk alone leads too few particles to the faults; hence the share.
    ///
    /// # Errors
    /// [`ProposalError`].
    pub fn risk_raised(
        model: &impl Modes,
        leave: f64,
        risk: &[f64],
    ) -> Result<Self, ProposalError> {
        if !(leave > 0.0 && leave < 1.0) {
            return Err(ProposalError::Share(leave));
        }
        hybrid::check(model)?;
        check_risk(model, risk)?;
        let is_other = |from: usize, to: usize| to != from && model.transition(from, to) > 0.0;
        let reached = |from: usize| -> f64 {
            let others = (0..risk.len()).filter(|&to| is_other(from, to));
            others.map(|to| risk[to]).sum()
        };
        let q = |from: usize, to: usize| {
            let total = reached(from);
            let stays = model.transition(from, from) > 0.0;
            match from == to {
                // A mode that leads nowhere else keeps all its draws.
                true if total <= 0.0 => 1.0,
                true if stays => 1.0 - leave,
                false if is_other(from, to) => leave * risk[to] / total,
                _ => 0.0,
            }
        };
        Self::build(model, q, risk)
    }

    fn build(
        model: &impl Modes,
        q: impl Fn(usize, usize) -> f64,
        risk: &[f64],
    ) -> Result<Self, ProposalError> {
        let modes = model.modes();
        let (mut cumulative, mut correction) = (Vec::new(), Vec::new());
        for from in 0..modes {
            let row: Vec<f64> = (0..modes).map(|to| q(from, to)).collect();
            let total: f64 = row.iter().sum();
            if !(total.is_finite() && total > 0.0) {
                let sum = total;
                return Err(ModelError::Transition { from, sum }.into());
            }
            let mut sum = 0.0;
            for (to, q) in row.iter().enumerate() {
                sum += q / total;
                cumulative.push(sum);
                let ratio = model.transition(from, to) / (q / total);
                correction.push(ratio.ln() + (risk[to] / risk[from]).ln());
            }
        }
        Ok(Self {
            modes,
            cumulative,
            correction,
            log_risk: risk.iter().map(|r| r.ln()).collect(),
        })
    }

    /// Number of modes.
    pub(crate) const fn modes(&self) -> usize {
        self.modes
    }

    /// The mode after `from` for a uniform draw `u` in [0, 1), and what to add to the log-weight.
    pub(crate) fn next(&self, from: usize, u: f64) -> (usize, f64) {
        assert!((0.0..1.0).contains(&u), "a uniform draw lies in [0, 1)");
        let row = from * self.modes..(from + 1) * self.modes;
        let cumulative = &self.cumulative[row.clone()];
        assert!(
            (cumulative[self.modes - 1] - 1.0).abs() <= SUM_TOLERANCE,
            "the probabilities of a proposal sum to one"
        );
        let passed = cumulative.partition_point(|&c| c <= u);
        // Rounding may leave the last sum below 1: the last mode that can be drawn is meant.
        let to = if passed < self.modes {
            passed
        } else {
            let top = cumulative[self.modes - 1];
            cumulative.partition_point(|&c| c < top)
        };
        (to, self.correction[row][to])
    }

    /// Logarithm of a mode's risk; 0 without risk.
    pub(crate) fn log_risk(&self, mode: usize) -> f64 {
        self.log_risk[mode]
    }
}

/// One finite risk above 0 for each mode.
fn check_risk(model: &impl Modes, risk: &[f64]) -> Result<(), ProposalError> {
    let modes = model.modes();
    if risk.len() != modes {
        let found = risk.len();
        return Err(ProposalError::Length { found, modes });
    }
    let bad = |r: &f64| !(r.is_finite() && *r > 0.0);
    match risk.iter().position(bad) {
        Some(mode) => {
            let found = risk[mode];
            Err(ProposalError::Risk { mode, found })
        }
        None if !risk.iter().sum::<f64>().is_finite() => Err(ProposalError::Sum),
        None => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two thirds stay in mode 0; modes 1 and 2 are for ever.
    struct Chain;

    impl Modes for Chain {
        fn modes(&self) -> usize {
            3
        }

        fn transition(&self, from: usize, to: usize) -> f64 {
            [[0.75, 0.125, 0.125], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]][from][to]
        }
    }

    #[test]
    fn draws_follow_the_cumulative_probabilities() {
        let prior = Proposal::prior(&Chain).unwrap();
        let expected = [(0.0, 0), (0.7499, 0), (0.75, 1), (0.8749, 1), (0.875, 2)];
        for (u, mode) in expected {
            assert_eq!(prior.next(0, u), (mode, 0.0), "{u}");
        }
        assert_eq!(prior.next(1, 0.0), (1, 0.0));
        assert_eq!(prior.next(2, 0.9999), (2, 0.0));
    }

    #[test]
    fn raised_draws_are_paid_by_the_ratio_of_the_probabilities() {
        let raised = Proposal::raised(&Chain, 0.5).unwrap();
        for (u, mode, ratio) in [
            (0.49, 0, 1.5_f64),
            (0.5, 1, 0.5),
            (0.74, 1, 0.5),
            (0.75, 2, 0.5),
        ] {
            let (found, correction) = raised.next(0, u);
            assert_eq!(found, mode);
            assert!((correction - ratio.ln()).abs() < 1e-12, "{u}: {correction}");
        }
        assert_eq!(raised.next(1, 0.5), (1, 0.0));
    }

    #[test]
    fn risks_share_the_draws_and_tilt_the_weights() {
        let risky = Proposal::risk_raised(&Chain, 0.5, &[2.0, 1.0, 3.0]).unwrap();
        // q = .5, .125, .375; P / q times r' / r.
        for (u, mode, factor) in [(0.3, 0, 1.5_f64), (0.6, 1, 0.5), (0.7, 2, 1.0 / 3.0 * 1.5)] {
            let (found, correction) = risky.next(0, u);
            assert_eq!(found, mode);
            assert!(
                (correction - factor.ln()).abs() < 1e-12,
                "{u}: {correction}"
            );
        }
        assert_eq!(risky.log_risk(2), 3.0_f64.ln());
        assert_eq!(risky.modes(), 3);
    }

    #[test]
    fn what_is_no_proposal_is_refused() {
        for share in [0.0, 1.0, -0.5, f64::NAN] {
            let refused = Proposal::raised(&Chain, share);
            assert!(matches!(refused, Err(ProposalError::Share(_))), "{share}");
        }
        let length = ProposalError::Length { found: 2, modes: 3 };
        assert_eq!(Proposal::risk_raised(&Chain, 0.5, &[1.0; 2]), Err(length));
        for bad in [0.0, -1.0, f64::INFINITY] {
            let risk = ProposalError::Risk {
                mode: 1,
                found: bad,
            };
            let refused = Proposal::risk_raised(&Chain, 0.5, &[1.0, bad, 1.0]);
            assert_eq!(refused, Err(risk));
        }
        let huge = Proposal::risk_raised(&Chain, 0.5, &[1.0, 1e308, 1e308]);
        assert_eq!(huge, Err(ProposalError::Sum));
    }

    #[test]
    #[should_panic(expected = "the probabilities of a proposal sum to one")]
    fn a_row_that_does_not_sum_to_one_is_caught() {
        let mut prior = Proposal::prior(&Chain).unwrap();
        prior.cumulative[2] = 0.9;
        prior.next(0, 0.5);
    }

    #[test]
    #[should_panic(expected = "a uniform draw lies in [0, 1)")]
    fn a_draw_of_one_is_caught() {
        Proposal::prior(&Chain).unwrap().next(0, 1.0);
    }
}
