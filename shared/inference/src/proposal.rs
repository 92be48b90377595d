//! Which mode a particle tries next, and how its weight pays for it.
//!
//! A filter may draw the next mode from any `q(d' | d)` that is positive wherever `P` is, if it
//! multiplies the weight by `P / q`: the estimates stay consistent. Raising the probability of
//! rare faults in `q` puts particles where they will be needed.
//!
//! The risk-sensitive filter (Thrun, Langford and Verma, *Risk Sensitive Particle Filters*, 2001)
//! goes one step further: it tracks `r(d) p(d, c | z)`, so that modes in which a lost track is
//! expensive keep their particles. Weights get the factor `r(d') / r(d)`; the belief is reported
//! without the tilt, each weight divided by its particle's risk.

use crate::hybrid::Modes;

/// Tables of a proposal for a fixed set of modes.
#[derive(Debug, Clone, PartialEq)]
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
}

impl Proposal {
    /// The model's own transitions: the bootstrap filter.
    #[must_use]
    pub fn prior(model: &impl Modes) -> Self {
        Self::build(
            model,
            |from, to| model.transition(from, to),
            &vec![1.0; model.modes()],
        )
    }

    /// From each mode a share `leave` of the draws goes to the other modes that the model can
    /// reach, in equal parts; the rest stays as the model has it.
    ///
    /// # Errors
    /// [`ProposalError::Share`].
    pub fn raised(model: &impl Modes, leave: f64) -> Result<Self, ProposalError> {
        let risk = vec![1.0; model.modes()];
        Self::risk_raised(model, leave, &risk)
    }

    /// Draws from `q ∝ r(d') P(d' | d)` and tracks the belief tilted by the risk `r`.
    ///
    /// # Errors
    /// [`ProposalError`] unless there is one finite risk above 0 for each mode.
    pub fn risk_sensitive(model: &impl Modes, risk: &[f64]) -> Result<Self, ProposalError> {
        check(model, risk)?;
        let q = |from: usize, to: usize| risk[to] * model.transition(from, to);
        Ok(Self::build(model, q, risk))
    }

    /// Both: a share `leave` of the draws goes to other modes, in proportion to their risks, and
    /// the belief is tracked tilted by the risk. Where risks differ by less than faults are rare,
    /// the risk alone leads too few particles to them.
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
        check(model, risk)?;
        let is_other = |from: usize, to: usize| to != from && model.transition(from, to) > 0.0;
        let reached = |from: usize| -> f64 {
            let others = (0..risk.len()).filter(|&to| is_other(from, to));
            others.map(|to| risk[to]).sum()
        };
        let q = |from: usize, to: usize| {
            let total = reached(from);
            let stays = model.transition(from, from) > 0.0;
            match from == to {
                true if total <= 0.0 => 1.0,
                true if stays => 1.0 - leave,
                false if is_other(from, to) => leave * risk[to] / total,
                _ => 0.0,
            }
        };
        Ok(Self::build(model, q, risk))
    }

    fn build(model: &impl Modes, q: impl Fn(usize, usize) -> f64, risk: &[f64]) -> Self {
        let modes = model.modes();
        let (mut cumulative, mut correction) = (Vec::new(), Vec::new());
        for from in 0..modes {
            let total: f64 = (0..modes).map(|to| q(from, to)).sum();
            let mut sum = 0.0;
            for to in 0..modes {
                sum += q(from, to) / total;
                cumulative.push(sum);
                let ratio = model.transition(from, to) / (q(from, to) / total);
                correction.push(ratio.ln() + (risk[to] / risk[from]).ln());
            }
        }
        Self {
            modes,
            cumulative,
            correction,
            log_risk: risk.iter().map(|r| r.ln()).collect(),
        }
    }

    /// Number of modes.
    #[must_use]
    pub const fn modes(&self) -> usize {
        self.modes
    }

    /// The mode after `from` for a uniform draw `u` in [0, 1), and what to add to the log-weight.
    #[must_use]
    pub fn next(&self, from: usize, u: f64) -> (usize, f64) {
        let row = from * self.modes..(from + 1) * self.modes;
        let cumulative = &self.cumulative[row.clone()];
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
    #[must_use]
    pub fn log_risk(&self, mode: usize) -> f64 {
        self.log_risk[mode]
    }
}

/// One finite risk above 0 for each mode.
fn check(model: &impl Modes, risk: &[f64]) -> Result<(), ProposalError> {
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
        None => Ok(()),
    }
}
