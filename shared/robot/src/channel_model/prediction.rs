//! The predictions of all channels at once.

use super::CHANNELS_MAX;
use super::channel::{Channel, Commands, Scales, Term};

/// Terms of all channels, each once: most channels share them.
#[derive(Debug, Clone)]
pub struct Predictor {
    terms: Vec<Term>,
    /// Weight of each term in each channel.
    weights: Vec<[f64; CHANNELS_MAX]>,
}

impl Predictor {
    /// Of these channels.
    #[must_use]
    pub fn new<'a>(channels: impl Iterator<Item = &'a Channel>) -> Self {
        let (mut terms, mut weights) = (Vec::new(), Vec::new());
        for (i, channel) in channels.enumerate().take(CHANNELS_MAX) {
            for (term, weight) in channel.terms.iter().zip(&channel.weights) {
                let known = terms.iter().position(|other| other == term);
                let place = known.unwrap_or_else(|| {
                    terms.push(*term);
                    weights.push([0.0; CHANNELS_MAX]);
                    terms.len() - 1
                });
                weights[place][i] += weight;
            }
        }
        Self { terms, weights }
    }

    /// The values predicted from the newest commands.
    #[must_use]
    pub fn predict(&self, commands: &Commands, scales: &Scales) -> [f64; CHANNELS_MAX] {
        let commands = scales.scaled(commands);
        let mut predicted = [0.0; CHANNELS_MAX];
        for (term, weights) in self.terms.iter().zip(&self.weights) {
            let value = term.value(&commands, scales);
            let sums = predicted.iter_mut().zip(weights);
            sums.for_each(|(sum, weight)| *sum += weight * value);
        }
        predicted
    }
}
