//! The lower bound: vectors over states, each the value of a plan.
//!
//! A vector knows its action and, for each observation, the vector whose plan goes on: together
//! they are a controller, whose value the vectors never exceed.

use super::blocks::Blocks;
use crate::bounds::ActionValues;
use crate::sparse_beliefs::{BeliefId, dot};

/// Index of a vector.
pub(super) type AlphaId = u32;

/// All vectors that were ever made; some of them are looked at when beliefs are valued.
#[derive(Debug, Clone)]
pub(super) struct Alphas {
    states: usize,
    observations: usize,
    values: Vec<f64>,
    actions: Vec<u32>,
    successors: Vec<AlphaId>,
    /// The belief at which each was made; none for the blind policies.
    origins: Vec<Option<BeliefId>>,
    blocks: Blocks,
    /// Those that are looked at, by the block of the beliefs at which they were made, then those of
    /// several blocks and the blind ones; by the instant of their last change.
    active: Vec<Vec<(u32, AlphaId)>>,
    stamp: u32,
}

impl Alphas {
    /// Begins with the blind policies. With discount 1 what they go on with is a lot, of all of
    /// them.
    pub(super) fn new(
        blind: &ActionValues,
        states: usize,
        observations: usize,
        blocks: Blocks,
    ) -> Self {
        let mut alphas = Self {
            states,
            observations,
            values: Vec::new(),
            actions: Vec::new(),
            successors: Vec::new(),
            origins: Vec::new(),
            active: vec![Vec::new(); blocks.count() + 1],
            blocks,
            stamp: 0,
        };
        for (action, row) in blind.rows().enumerate() {
            let itself = vec![action as AlphaId; observations];
            alphas.push((None, &[]), action, row, &itself);
        }
        alphas
    }

    /// How many there are.
    pub(super) fn len(&self) -> usize {
        self.actions.len()
    }

    /// How many are looked at.
    pub(super) fn active_count(&self) -> usize {
        self.active.iter().map(Vec::len).sum()
    }

    /// Instant of the last change.
    pub(super) fn stamp(&self) -> u32 {
        self.stamp
    }

    pub(super) fn values(&self, id: AlphaId) -> &[f64] {
        &self.values[id as usize * self.states..][..self.states]
    }

    /// The belief at which a vector was made; none for a blind policy.
    pub(super) fn origin(&self, id: AlphaId) -> Option<BeliefId> {
        self.origins[id as usize]
    }

    pub(super) fn action(&self, id: AlphaId) -> usize {
        self.actions[id as usize] as usize
    }

    /// For each observation, the vector that goes on.
    pub(super) fn successors(&self, id: AlphaId) -> &[AlphaId] {
        &self.successors[id as usize * self.observations..][..self.observations]
    }

    pub(super) fn value(&self, id: AlphaId, belief: &[(u32, f64)]) -> f64 {
        dot(self.values(id), belief)
    }

    /// Adds a vector that was made at the belief `origin`, with its entries.
    pub(super) fn push(
        &mut self,
        (origin, belief): (Option<BeliefId>, &[(u32, f64)]),
        action: usize,
        values: &[f64],
        successors: &[AlphaId],
    ) -> AlphaId {
        assert!(
            values.iter().all(|v| v.is_finite()),
            "vectors of the solver are finite"
        );
        let id = self.len() as AlphaId;
        self.origins.push(origin);
        self.actions.push(action as u32);
        self.values.extend_from_slice(values);
        self.successors.extend_from_slice(successors);
        self.stamp += 1;
        let block = self.blocks.around(belief);
        let block = block.unwrap_or(self.blocks.count());
        self.active[block].push((self.stamp, id));
        id
    }

    /// The best vector at a belief among those newer than `seen`, if it beats `best`; and the
    /// number of vectors looked at.
    pub(super) fn best_since(
        &self,
        seen: u32,
        belief: &[(u32, f64)],
        mut best: (AlphaId, f64),
    ) -> ((AlphaId, f64), usize) {
        let count = self.blocks.count();
        let of_several = &self.active[count..];
        let own = match self.blocks.around(belief) {
            Some(block) => &self.active[block..=block],
            None => &self.active[..count],
        };
        let newer = own.iter().chain(of_several).flat_map(|vectors| {
            let newest_first = vectors.iter().rev();
            newest_first.take_while(|(stamp, _)| *stamp > seen)
        });
        let mut looked_at = 0;
        for (_, id) in newer {
            looked_at += 1;
            let value = self.value(*id, belief);
            if value > best.1 {
                best = (*id, value);
            }
        }
        (best, looked_at)
    }

    /// Goes on looking only at those that `keep` says.
    pub(super) fn retain(&mut self, keep: impl Fn(AlphaId) -> bool) {
        for vectors in &mut self.active {
            vectors.retain(|(_, id)| keep(*id));
        }
    }

    /// Those that are looked at.
    pub(super) fn active(&self) -> impl Iterator<Item = AlphaId> {
        let (own, of_several) = self.active.split_at(self.blocks.count());
        let lists = of_several.iter().chain(own);
        lists.flatten().map(|(_, id)| *id)
    }
}

#[test]
#[should_panic(expected = "vectors of the solver are finite")]
fn a_vector_that_is_not_finite_is_caught() {
    let model = "discount: 0 states: 2 actions: 1 observations: 1 T: * identity O: * uniform";
    let blocks = Blocks::new(&crate::Pomdp::parse(model).unwrap());
    let mut alphas = Alphas::new(&ActionValues::new(2, vec![0.0, 1.0]), 2, 1, blocks);
    assert_eq!(alphas.len(), 1);
    alphas.push((None, &[]), 0, &[0.0, f64::INFINITY], &[0]);
}
