//! All channels of a set together, from one onset on.
//!
//! What changes a robot as a whole (another ground, a load, a flat tyre) shifts several channels at
//! once, each of them by little. One learned bias over all of them adds up what each channel alone
//! leaves below its alarm. A bias of the same total size as that of one channel is expected, spread
//! over all of them.

use nalgebra::SVector;
use serde::{Deserialize, Serialize};
use vigil_inference::ages::Ages;

use super::channel::{CHANNELS_MAX, Tail};
use crate::learned::Form;

/// How the joint log-odds of a set of channels behave without a fault; only
/// [`Form::LearnedBias`] has such.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Joint {
    /// Set of channels: `pose` or `pose+encoders`.
    pub sensors: String,
    /// The tail by which the log-odds are tempered.
    pub tail: Tail,
}

/// The joint evidence at work.
#[derive(Debug, Clone)]
pub(super) struct Together {
    bias: Ages<CHANNELS_MAX>,
    channels: usize,
    bias_sd: f64,
    whitened: SVector<f64, CHANNELS_MAX>,
    found: usize,
    gain: f64,
}

impl Together {
    /// Of so many channels, with the deviation of a bias that stands in one channel alone; none
    /// for a single channel, and for other forms.
    pub fn new(form: Form, channels: usize, bias_sd: f64) -> Option<Self> {
        let several = (2..=CHANNELS_MAX).contains(&channels);
        (several && form == Form::LearnedBias).then(|| {
            let bias_sd = bias_sd / (channels as f64).sqrt();
            Self {
                bias: Ages::with_dimensions(channels, bias_sd),
                channels,
                bias_sd,
                whitened: SVector::zeros(),
                found: 0,
                gain: 0.0,
            }
        })
    }

    /// No evidence yet.
    pub fn forget(&mut self) {
        self.bias = Ages::with_dimensions(self.channels, self.bias_sd);
        self.gain = 0.0;
    }

    /// An observation begins.
    pub fn begin(&mut self) {
        (self.found, self.gain) = (0, 0.0);
    }

    /// The whitened residual of one of its channels.
    pub fn add(&mut self, whitened: f64) {
        if let Some(slot) = self.whitened.get_mut(self.found) {
            *slot = whitened;
            self.found += 1;
        }
    }

    /// True if the observation holds every channel: one that lacks any says nothing here.
    pub const fn is_complete(&self) -> bool {
        self.found == self.channels
    }

    /// The observation ends.
    pub fn step(&mut self, birth: f64) {
        self.gain = 0.0;
        if self.is_complete() {
            self.bias.step(&self.whitened, birth);
            self.gain = self.bias.gain();
        }
    }

    /// What the last observation said for a fault that was there, and is.
    pub fn gain(&self) -> f64 {
        self.gain
    }

    /// Natural log-odds, as they come.
    pub fn log_odds(&self) -> f64 {
        self.bias.log_odds()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn small_shifts_of_all_channels_add_up_and_gaps_say_nothing() {
        let mut joint = Together::new(Form::LearnedBias, 9, 3.0).unwrap();
        let mut alone = Ages::<1>::new(3.0);
        for _ in 0..8 {
            joint.begin();
            (0..9).for_each(|_| joint.add(1.5));
            joint.step(1e-5);
            alone.step(&SVector::from([1.5]), 1e-5);
        }
        assert!(joint.log_odds() > 40.0, "{}", joint.log_odds());
        assert!(alone.log_odds() < 0.0, "{}", alone.log_odds());
        let before = joint.log_odds();
        joint.begin();
        (0..8).for_each(|_| joint.add(6.0));
        joint.step(1e-5);
        assert_eq!(joint.log_odds(), before);
        joint.forget();
        assert_eq!(joint.log_odds(), -vigil_inference::ages::LOG_ODDS_MAX);
    }

    #[test]
    fn one_channel_and_the_constant_forms_have_none() {
        assert!(Together::new(Form::LearnedBias, 1, 3.0).is_none());
        assert!(Together::new(Form::LearnedBias, 2, 3.0).is_some());
        assert!(Together::new(Form::Constant, 9, 3.0).is_none());
        assert!(Together::new(Form::Windowed, 9, 3.0).is_none());
    }
}
