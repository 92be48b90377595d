//! The policy of a search.

use super::alphas::AlphaId;
use super::tree::Tree;
use crate::alpha_vectors::{AlphaVectors, VectorError};
use crate::sparse_beliefs::BeliefId;

/// Comparisons of vectors, at most; some 20 ms.
const COMPARISONS_MAX: usize = 5_000_000;

impl Tree<'_> {
    /// The vectors that a policy needs: those that are looked at; the plan from `root` with all
    /// that it goes on to, so that the policy keeps what the lower bound promises; and the blind
    /// policies, so that every action has a value. Where a plan goes on to a vector that another
    /// one beats in every state, that one does instead.
    pub(super) fn vectors(&self, root: BeliefId) -> Result<AlphaVectors, VectorError> {
        let actions = self.model.actions().len();
        let mut needed: Vec<AlphaId> = self.alphas.active().collect();
        needed.extend(0..actions as AlphaId);
        // Settled: it is known what stands for it. Closed: so is all that its plan goes on to.
        let mut is_settled = vec![false; self.alphas.len()];
        let mut is_closed = is_settled.clone();
        needed.iter().for_each(|id| is_settled[*id as usize] = true);
        let mut comparisons = 0;
        let mut open: Vec<AlphaId> = vec![self.nodes[root as usize].witness];
        while let Some(id) = open.pop() {
            let mut stands = id;
            if !std::mem::replace(&mut is_settled[id as usize], true) {
                comparisons += needed.len();
                let is_compared = comparisons < COMPARISONS_MAX;
                let better = needed
                    .iter()
                    .find(|one| is_compared && self.beats(**one, id));
                match better {
                    Some(better) => {
                        is_closed[id as usize] = true;
                        stands = *better;
                    }
                    None => needed.push(id),
                }
            }
            if !std::mem::replace(&mut is_closed[stands as usize], true) {
                open.extend(self.alphas.successors(stands));
            }
        }
        needed.sort_unstable();
        needed.dedup();
        let rows = needed
            .iter()
            .map(|id| (self.alphas.action(*id), self.alphas.of(*id)));
        AlphaVectors::new(self.model.states().len(), actions, rows)
    }

    fn beats(&self, one: AlphaId, other: AlphaId) -> bool {
        let pairs = self.alphas.of(one).iter().zip(self.alphas.of(other));
        pairs.into_iter().all(|(one, other)| one >= other)
    }
}
