//! Vectors and points that do nothing any more.

use super::tree::Tree;
use crate::budget::{Budget, StopRequest};
use crate::sparse_beliefs::BeliefId;

impl Tree<'_> {
    /// Goes on looking only at vectors that are the best at an expanded belief.
    pub(super) fn prune_alphas(&mut self, budget: &mut Budget<'_>) -> Result<(), StopRequest> {
        let mut is_best = vec![false; self.alphas.len()];
        for id in 0..self.nodes.len() {
            if self.nodes[id].branches.is_some() {
                self.lower(id as BeliefId, budget)?;
                is_best[self.nodes[id].witness as usize] = true;
            }
        }
        self.alphas.retain(|id| is_best[id as usize]);
        Ok(())
    }

    /// Takes out the points to which others give a lower value.
    pub(super) fn prune_points(&mut self, budget: &mut Budget<'_>) -> Result<(), StopRequest> {
        let points: Vec<BeliefId> = self.sawtooth.beliefs().collect();
        for id in points {
            self.upper(id, budget)?;
        }
        let nodes = &self.nodes;
        self.sawtooth.retain(|id, value| {
            let upper = nodes[id as usize].upper;
            upper >= value - 1e-12 * value.abs()
        });
        Ok(())
    }
}
