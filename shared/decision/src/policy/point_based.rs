//! The policy of a point-based solution: begin the plan that is worth most.

use super::{Choice, Policy, choose};
use crate::alpha_vectors::AlphaVectors;

/// The action of argmax_alpha alpha·b.
///
/// The value of an action is that of the best vector which begins with it: what is earned for
/// certain if it is taken now. No look-ahead at decision time: the vectors hold it already, one
/// costs |states| operations each, and the guarantee of the lower bound is theirs. Take
/// [`super::QMdp`] or another heuristic when there is no time to solve beforehand.
#[derive(Debug, Clone, PartialEq)]
pub struct PointBased {
    vectors: AlphaVectors,
}

impl PointBased {
    /// The policy of these vectors.
    #[must_use]
    pub const fn new(vectors: AlphaVectors) -> Self {
        Self { vectors }
    }

    /// Its vectors.
    #[must_use]
    pub const fn vectors(&self) -> &AlphaVectors {
        &self.vectors
    }
}

impl Policy for PointBased {
    /// An action that no vector begins with has the value minus infinity.
    fn evaluate(&mut self, belief: &[f64], values: &mut [f64]) -> Choice {
        values.fill(f64::NEG_INFINITY);
        for (action, alpha) in self.vectors.rows() {
            if let Some(value) = values.get_mut(action) {
                let here = alpha.iter().zip(belief).map(|(v, b)| v * b).sum();
                *value = value.max(here);
            }
        }
        choose(values)
    }
}
