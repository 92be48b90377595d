//! Starts drawn around a model, row by row from Dirichlet distributions.

use rand::Rng;
use rand_distr::{Distribution, Gamma};

use super::layout::Layout;

/// A drawn start is as far from the prior as a sample of so many visits is from its mean.
const START_VISITS: f64 = 10.0;
/// Share of the prior in a drawn start, so that nothing is ruled out.
const START_PRIOR_SHARE: f64 = 0.1;

/// Probabilities around those of `hand`. A row whose weights are too small to draw anything from
/// stays as it is.
pub(super) fn around(layout: &Layout, hand: &[f64], generator: &mut impl Rng) -> Vec<f64> {
    let draw = |p: &f64| {
        let gamma = Gamma::new(p * START_VISITS, 1.0).ok();
        gamma.map_or(0.0, |gamma| gamma.sample(generator))
    };
    let mut values: Vec<f64> = hand.iter().map(draw).collect();
    for row in layout.rows() {
        let sum: f64 = values[row.clone()].iter().sum();
        if sum > 0.0 && sum.is_finite() {
            values[row].iter_mut().for_each(|value| *value /= sum);
        } else {
            values[row.clone()].copy_from_slice(&hand[row]);
        }
    }
    for (value, hand) in values.iter_mut().zip(hand) {
        *value = (1.0 - START_PRIOR_SHARE) * *value + START_PRIOR_SHARE * hand;
    }
    values
}
