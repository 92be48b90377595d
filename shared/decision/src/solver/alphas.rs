//! The lower bound: vectors over states, each the value of a plan.
//!
//! A vector knows its action and, for each observation, the vector whose plan goes on: together
//! they are a controller, whose value the vectors never exceed.

use crate::bounds::ActionValues;

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
    /// Those that are looked at, by the instant of their last change.
    active: Vec<(u32, AlphaId)>,
    stamp: u32,
}

impl Alphas {
    /// Begins with the blind policies.
    pub(super) fn new(blind: &ActionValues, states: usize, observations: usize) -> Self {
        let mut alphas = Self {
            states,
            observations,
            values: Vec::new(),
            actions: Vec::new(),
            successors: Vec::new(),
            active: Vec::new(),
            stamp: 0,
        };
        for (action, row) in blind.rows().enumerate() {
            let itself = vec![action as AlphaId; observations];
            alphas.push(action, row, &itself);
        }
        alphas
    }

    /// How many there are.
    pub(super) fn len(&self) -> usize {
        self.actions.len()
    }

    /// How many are looked at.
    pub(super) fn active_count(&self) -> usize {
        self.active.len()
    }

    /// Instant of the last change.
    pub(super) fn stamp(&self) -> u32 {
        self.stamp
    }

    pub(super) fn of(&self, id: AlphaId) -> &[f64] {
        &self.values[id as usize * self.states..][..self.states]
    }

    pub(super) fn action(&self, id: AlphaId) -> usize {
        self.actions[id as usize] as usize
    }

    /// For each observation, the vector that goes on.
    pub(super) fn successors(&self, id: AlphaId) -> &[AlphaId] {
        &self.successors[id as usize * self.observations..][..self.observations]
    }

    pub(super) fn value(&self, id: AlphaId, belief: &[(u32, f64)]) -> f64 {
        let alpha = self.of(id);
        belief.iter().map(|(s, b)| b * alpha[*s as usize]).sum()
    }

    pub(super) fn push(
        &mut self,
        action: usize,
        values: &[f64],
        successors: &[AlphaId],
    ) -> AlphaId {
        let id = self.len() as AlphaId;
        self.actions.push(action as u32);
        self.values.extend_from_slice(values);
        self.successors.extend_from_slice(successors);
        self.stamp += 1;
        self.active.push((self.stamp, id));
        id
    }

    /// Raises a vector where `values` are larger; true if they are somewhere.
    pub(super) fn raise(&mut self, id: AlphaId, values: &[f64]) -> bool {
        let alpha = &mut self.values[id as usize * self.states..][..self.states];
        let mut is_raised = false;
        for (old, new) in alpha.iter_mut().zip(values) {
            if *new > *old {
                *old = *new;
                is_raised = true;
            }
        }
        is_raised
    }

    /// Vectors were raised: those of them that are looked at count as new.
    pub(super) fn renew(&mut self, is_raised: impl Fn(AlphaId) -> bool) {
        self.stamp += 1;
        let stamp = self.stamp;
        for slot in &mut self.active {
            if is_raised(slot.1) {
                slot.0 = stamp;
            }
        }
        self.active.sort_by_key(|(stamp, _)| *stamp);
    }

    /// The best vector at a belief among those newer than `seen`, if it beats `best`; and the
    /// number of vectors looked at.
    pub(super) fn best_since(
        &self,
        seen: u32,
        belief: &[(u32, f64)],
        mut best: (AlphaId, f64),
    ) -> ((AlphaId, f64), usize) {
        let newer = self.active.iter().rev();
        let mut looked_at = 0;
        for (_, id) in newer.take_while(|(stamp, _)| *stamp > seen) {
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
        self.active.retain(|(_, id)| keep(*id));
    }

    /// Those that are looked at.
    pub(super) fn active(&self) -> impl Iterator<Item = AlphaId> {
        self.active.iter().map(|(_, id)| *id)
    }
}
