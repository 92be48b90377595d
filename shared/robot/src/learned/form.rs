//! How a group of channels turns its whitened residuals into evidence for a fault.

use vigil_checkpoint::CheckpointValue;
use vigil_inference::ages::{self, Ages, WhitenedResidual};
use vigil_inference::constant::Constant;
use vigil_inference::outlier::tempered;
use vigil_inference::windowed::Windowed;

/// Constant of the paper's forms per dimension: above 1, or nominal residuals are evidence. Health
/// loses (1.6 - 1) / 2 = 0.3 nats an observation and dimension.
pub const TAU_SQUARED_PER_DIMENSION: f64 = 1.6;
/// Observations in a window: half a second. Longer ones see smaller faults, and fall more slowly.
const WINDOW: usize = 10;
/// Probability that a fault vanishes in a step of the constant forms: bounds their log-odds at
/// about 21, above the alarm of any usual setting, and not so high that they never fall again.
const VANISHES: f64 = 1e-9;
/// Deviation of what a broken channel reads if it reads anything, in units of the residual's: that
/// of an outlier.
const ANYTHING: f64 = 10.0;

/// What the fault state says of a residual.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Form {
    /// It has an unknown constant bias, which is learned.
    #[default]
    LearnedBias,
    /// Its likelihood is a constant (the paper's form). Blind to small biases.
    Constant,
    /// The same over windows of half a second: less blind, and later by up to a window.
    Windowed,
}

impl Form {
    /// Log-odds that a group of channels cannot exceed for long, however long a fault lasts: an
    /// alarm above them might never rise.
    #[must_use]
    pub fn log_odds_max(self) -> f64 {
        match self {
            Self::LearnedBias => ages::LOG_ODDS_MAX,
            Self::Constant | Self::Windowed => -VANISHES.ln(),
        }
    }

    /// Every form.
    pub const ALL: [Self; 3] = [Self::LearnedBias, Self::Constant, Self::Windowed];

    /// Name, as calibrations carry it.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::LearnedBias => "learned-bias",
            Self::Constant => "constant",
            Self::Windowed => "windowed",
        }
    }
}

/// Detection over the residuals of one group, of D dimensions.
#[derive(Debug, Clone, Copy, CheckpointValue)]
pub(crate) enum Evidence<const D: usize> {
    LearnedBias(Ages<D>),
    Constant(Constant),
    Windowed(Windowed<D, WINDOW>),
}

impl<const D: usize> Evidence<D> {
    /// None yet. `bias_sd`: standard deviation of a fault's bias in units of the residual's, where
    /// it is learned.
    pub(crate) fn new(form: Form, bias_sd: f64) -> Self {
        match form {
            Form::LearnedBias => Self::LearnedBias(Ages::new(bias_sd)),
            Form::Constant => Self::Constant(Constant::default()),
            Form::Windowed => Self::Windowed(Windowed::default()),
        }
    }

    /// Natural log-odds of a fault in this group.
    pub(crate) fn log_odds(&self) -> f64 {
        match self {
            Self::LearnedBias(filter) => filter.log_odds(),
            Self::Constant(filter) => filter.log_odds(),
            Self::Windowed(filter) => filter.log_odds(),
        }
    }

    /// What the last residual said for a fault that was there, and is.
    pub(crate) fn gain(&self) -> f64 {
        match self {
            Self::LearnedBias(filter) => filter.gain(),
            Self::Constant(filter) => filter.gain(),
            Self::Windowed(filter) => filter.gain(),
        }
    }

    /// Takes a residual; `birth` is the probability that a fault appears with it.
    pub(crate) fn step(&mut self, residual: &WhitenedResidual<D>, birth: f64) {
        let tau_squared = TAU_SQUARED_PER_DIMENSION * D as f64;
        if let Self::LearnedBias(filter) = self {
            return filter.take(residual, birth);
        }
        let rate = residual.outlier_rate;
        let residual = &residual.value.map(|value| tempered(value, rate));
        match self {
            Self::LearnedBias(_) => {}
            Self::Constant(filter) => {
                filter.step(residual.norm_squared(), tau_squared, birth, VANISHES);
            }
            Self::Windowed(filter) => filter.step(residual, tau_squared, birth, VANISHES),
        }
    }
}

/// By how much more likely the square of a whitened residual is from a channel that reads anything
/// than from a whole one (natural logarithm). Where a fault is known to have been, an outlier is
/// rather the fault's than the sensor's.
pub(super) fn log_ratio_any(square: f64) -> f64 {
    let wide = 1.0 + ANYTHING * ANYTHING;
    0.5 * (square * (1.0 - 1.0 / wide) - wide.ln())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Log-odds after 200 equal residuals of one dimension.
    fn after(form: Form, residual: f64) -> f64 {
        let mut evidence = Evidence::<1>::new(form, 1.0);
        for _ in 0..200 {
            evidence.step(&WhitenedResidual::new(residual, 1.0, 0.0, 0.0), 1e-6);
        }
        evidence.log_odds()
    }

    #[test]
    fn only_the_constant_form_is_blind_to_a_bias_of_one_deviation() {
        for form in Form::ALL {
            assert!(after(form, 0.0) < -10.0, "{form:?}");
            assert_eq!(after(form, 1.0) > 5.0, form != Form::Constant, "{form:?}");
            assert!(after(form, 4.0) > 20.0, "{form:?}");
        }
    }

    #[test]
    fn names_tell_the_forms_apart() {
        let names = Form::ALL.map(Form::name);
        assert_eq!(names, ["learned-bias", "constant", "windowed"]);
        assert_eq!(Form::default(), Form::LearnedBias);
    }
}
