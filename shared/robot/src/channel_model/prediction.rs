//! The predictions of all channels at once.

use super::CHANNELS_MAX;
use super::channel::{Channel, Commands, Scales, Term};

/// Terms of all channels, each once: most channels share them.
#[derive(Debug, Clone)]
pub struct Predictor {
    terms: Vec<Term>,
    /// Value of each under the commands of the last prediction.
    values: Vec<f64>,
    /// Of each channel its terms' places and weights.
    weights: Vec<Vec<(usize, f64)>>,
}

impl Predictor {
    /// Of these channels.
    #[must_use]
    pub fn new<'a>(channels: impl Iterator<Item = &'a Channel>) -> Self {
        let mut terms: Vec<Term> = Vec::new();
        let mut place = |term: &Term| match terms.iter().position(|other| other == term) {
            Some(place) => place,
            None => {
                terms.push(*term);
                terms.len() - 1
            }
        };
        let weights = channels.map(|channel| {
            let terms = channel.terms.iter().zip(&channel.weights);
            terms.map(|(term, weight)| (place(term), *weight)).collect()
        });
        let weights = weights.collect();
        Self {
            values: vec![0.0; terms.len()],
            terms,
            weights,
        }
    }

    /// The values predicted from the newest commands; the same as [`Channel::predict`] gives.
    pub fn predict(&mut self, commands: &Commands, scales: &Scales) -> [f64; CHANNELS_MAX] {
        for (value, term) in self.values.iter_mut().zip(&self.terms) {
            *value = term.value(commands, scales);
        }
        let mut predicted = [0.0; CHANNELS_MAX];
        for (slot, weights) in predicted.iter_mut().zip(&self.weights) {
            let parts = weights.iter();
            *slot = parts
                .map(|(place, weight)| weight * self.values[*place])
                .sum();
        }
        predicted
    }
}
