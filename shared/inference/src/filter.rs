//! What every filter offers, the sampled ones and the exact.

/// A recursive Bayes filter over modes.
pub trait Filter {
    /// What is observed in one step.
    type Observation: ?Sized;

    /// Predicts one step and conditions on the observation.
    fn step(&mut self, z: &Self::Observation) -> Step;

    /// Posterior probability of each mode after the last step: finite, and its sum is 1.
    fn posterior(&self) -> &[f64];

    /// Begins anew from the prior, with the generator's present state.
    fn reset(&mut self);
}

/// What a filter says about one step.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Step {
    /// Estimate of `ln p(z_t | z_1 .. z_{t-1})`; 0 for a step without a usable observation.
    pub log_evidence: f64,
    /// `1 / Σ W²` over the normalised weights of particles or hypotheses, before resampling.
    pub effective_sample_size: f64,
    /// What went wrong, if something did.
    pub event: Option<Event>,
}

/// A step that could not be taken as it should.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Event {
    /// No particle or hypothesis explains the observation, or it is not finite: the belief was
    /// predicted, not updated.
    Coasted,
    /// The same for so many steps in a row that the continuous state was drawn anew around the
    /// observation; the belief over modes is the prior's.
    Restarted,
}

/// Writes `exp(log_p)` normalised into `p`; the sum is exactly as close to 1 as rounding allows.
/// False, and `p` unchanged, if no term is finite.
pub(crate) fn normalise_into(log_p: &[f64], p: &mut [f64]) -> bool {
    let highest = log_p.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    if !highest.is_finite() {
        return false;
    }
    let mut sum = 0.0;
    for (p, log_p) in p.iter_mut().zip(log_p) {
        let value = (log_p - highest).exp();
        // Not a number is impossible.
        *p = if value.is_nan() { 0.0 } else { value };
        sum += *p;
    }
    for p in p.iter_mut() {
        *p /= sum;
    }
    true
}
