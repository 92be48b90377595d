//! The policy of a search.

use super::alphas::AlphaId;
use super::tree::Tree;
use crate::alpha_vectors::{AlphaVectors, VectorError};
use crate::sparse_beliefs::BeliefId;

impl Tree<'_> {
    /// The vectors that a policy needs: the plan from `root` with all that it goes on to, so that
    /// the policy keeps what the lower bound promises; those that are looked at, for beliefs off
    /// the plan; and the blind policies, so that every action has a value.
    pub(super) fn vectors(&self, root: BeliefId) -> Result<AlphaVectors, VectorError> {
        let actions = self.model.actions().len();
        let mut is_needed = vec![false; self.alphas.len()];
        is_needed[..actions].fill(true);
        let mut open: Vec<AlphaId> = vec![self.nodes[root as usize].witness];
        while let Some(id) = open.pop() {
            if !std::mem::replace(&mut is_needed[id as usize], true) {
                open.extend(self.alphas.successors(id));
            }
        }
        self.alphas
            .active()
            .for_each(|id| is_needed[id as usize] = true);
        let needed = (0..self.alphas.len() as AlphaId).filter(|id| is_needed[*id as usize]);
        let rows = needed.map(|id| (self.alphas.action(id), self.alphas.of(id)));
        AlphaVectors::new(self.model.states().len(), actions, rows)
    }
}
