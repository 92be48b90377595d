//! The policy of a search.

use super::alphas::AlphaId;
use super::tree::Tree;
use crate::alpha_vectors::{AlphaVectors, VectorError};
use crate::sparse_beliefs::BeliefId;

/// Comparisons of vectors, at most; some 20 ms. Chosen: an export is part of every stop, and must
/// not outlast its time.
const COMPARISONS_MAX: usize = 5_000_000;
/// Comparisons of all that are needed with each other, at most; some 20 ms.
const UNBEATEN_MAX: usize = 2_000_000;

impl Tree<'_> {
    /// The vectors that a policy needs: those that are looked at, the plan from `root`, and all
    /// that these go on to, so that a policy earns at least what its vectors say. Where a plan goes
    /// on to a vector that another one beats in every state, that one does instead; what is beaten
    /// so is left out. An action that is never the best may be without a vector.
    pub(super) fn vectors(&self, root: BeliefId) -> Result<AlphaVectors, VectorError> {
        let actions = self.model.actions().len();
        let mut needed: Vec<AlphaId> = self.alphas.active().collect();
        // Settled: it is known what stands for it. Closed: so is all that its plan goes on to.
        let mut is_settled = vec![false; self.alphas.len()];
        let mut is_closed = is_settled.clone();
        needed.iter().for_each(|id| is_settled[*id as usize] = true);
        let mut comparisons = 0;
        let mut open = needed.clone();
        open.push(self.nodes[root as usize].witness);
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
                if self.alphas.origin(stands).is_none() && self.model.discount() >= 1.0 {
                    // Goes on by lot, that is, with any of them.
                    open.extend(0..actions as AlphaId);
                }
            }
        }
        needed.sort_unstable();
        needed.dedup();
        let needed = self.unbeaten(needed);
        let rows = needed
            .iter()
            .map(|id| (self.alphas.action(*id), self.alphas.values(*id)));
        AlphaVectors::new(self.model.states().len(), actions, rows)
    }

    /// Takes out what another one beats in every state; of equal ones the first stays.
    fn unbeaten(&self, ids: Vec<AlphaId>) -> Vec<AlphaId> {
        // What beats another has the larger sum.
        let sum = |id: AlphaId| (self.alphas.values(id).iter().sum::<f64>(), id);
        let mut by_sum: Vec<(f64, AlphaId)> = ids.into_iter().map(sum).collect();
        by_sum.sort_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
        let mut kept: Vec<AlphaId> = Vec::with_capacity(by_sum.len());
        let mut comparisons = 0;
        for (_, id) in by_sum {
            let is_compared = comparisons < UNBEATEN_MAX;
            let beats = |one: &AlphaId| is_compared && self.beats(*one, id);
            let better = kept.iter().position(beats);
            comparisons += better.unwrap_or(kept.len());
            match better {
                // What beats one is likely to beat the next.
                Some(at) => kept.swap(at / 2, at),
                None => kept.push(id),
            }
        }
        kept.sort_unstable();
        kept
    }

    fn beats(&self, one: AlphaId, other: AlphaId) -> bool {
        let pairs = self
            .alphas
            .values(one)
            .iter()
            .zip(self.alphas.values(other));
        pairs.into_iter().all(|(one, other)| one >= other)
    }
}
