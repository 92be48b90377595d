//! One step of dynamic programming at one belief, of both bounds.

use super::alphas::AlphaId;
use super::tree::Tree;
use crate::budget::{Budget, StopRequest};
use crate::sparse_beliefs::BeliefId;

/// An improvement below this, relative to the value, is rounding.
const ROUNDING: f64 = 1e-14;

impl Tree<'_> {
    /// Lowers the upper bound of a node; returns the action that has it.
    ///
    /// Actions are looked at from the most promising on; those that older bounds rule out stay
    /// unexpanded.
    pub(super) fn lower_upper(
        &mut self,
        id: BeliefId,
        budget: &mut Budget<'_>,
    ) -> Result<usize, StopRequest> {
        let before = self.upper(id, budget)?;
        budget.spend(10 * self.model.actions().len())?;
        let first = self.branches_of(id, budget)?;
        let actions = self.model.actions().len();
        let mut fresh = vec![false; actions];
        let best = loop {
            let mut best = 0;
            for a in 1..actions {
                if self.branches[first + a].upper > self.branches[first + best].upper {
                    best = a;
                }
            }
            if fresh[best] {
                break best;
            }
            fresh[best] = true;
            let mut next = 0.0;
            let children = self.children_of(id, best, budget)?;
            budget.spend(10 * children.len())?;
            for child in children {
                let child = self.children[child];
                next += child.probability * self.upper(child.node, budget)?;
            }
            let branch = &mut self.branches[first + best];
            branch.upper = (branch.reward + self.model.discount() * next).min(branch.upper);
        };
        let upper = self.branches[first + best].upper;
        if upper < before - ROUNDING * before.abs() {
            self.nodes[id as usize].upper = upper;
            self.sawtooth.put(&self.beliefs, id, upper);
        }
        Ok(best)
    }

    /// Raises the lower bound of a node, if one step of planning can.
    pub(super) fn raise_lower(
        &mut self,
        id: BeliefId,
        budget: &mut Budget<'_>,
    ) -> Result<(), StopRequest> {
        let before = self.lower(id, budget)?;
        let first = self.branches_of(id, budget)?;
        let mut best = (0, before + ROUNDING * before.abs().max(1e-3), false);
        let held = self.alphas.action(self.nodes[id as usize].witness);
        let greedy = (1..self.model.actions().len()).fold(0, |best, a| {
            if self.branches[first + a].upper > self.branches[first + best].upper {
                a
            } else {
                best
            }
        });
        for a in 0..self.model.actions().len() {
            if self.branches[first + a].upper <= best.1 {
                continue;
            }
            if !self.is_thorough && a != held && a != greedy {
                continue;
            }
            let mut next = 0.0;
            let children = self.children_of(id, a, budget)?;
            budget.spend(10 * children.len())?;
            for child in children {
                let child = self.children[child];
                next += child.probability * self.lower(child.node, budget)?;
            }
            let q = self.branches[first + a].reward + self.model.discount() * next;
            if q > best.1 {
                best = (a, q, true);
            }
        }
        if best.2 {
            self.plan(id, best.0, budget)?;
            self.lower(id, budget)?;
        }
        Ok(())
    }

    /// Adds the vector of the plan: `action` at this node, then what is best at its children.
    fn plan(
        &mut self,
        id: BeliefId,
        action: usize,
        budget: &mut Budget<'_>,
    ) -> Result<(), StopRequest> {
        let children = self.children_of(id, action, budget)?;
        let children = &self.children[children];
        // What cannot be observed here goes on as what is most probable.
        let mut probable = (0.0, 0);
        for child in children {
            if child.probability > probable.0 {
                probable = (child.probability, self.nodes[child.node as usize].witness);
            }
        }
        let mut successors: Vec<AlphaId> = vec![probable.1; self.model.observations().len()];
        for child in children {
            successors[child.observation as usize] = self.nodes[child.node as usize].witness;
        }
        let values = self.backed_up(action, &successors);
        let origin = (Some(id), self.beliefs.entries(id));
        self.alphas.push(origin, action, &values, &successors);
        let states = self.model.states().len();
        budget.spend(states * (states + successors.len()) / 2)
    }

    /// R(.,a) + gamma sum_o sum_s' T(.,a,s') Z(a,s',o) alpha_o(s').
    pub(super) fn backed_up(&self, action: usize, successors: &[AlphaId]) -> Vec<f64> {
        let model = self.model;
        let states = model.states().len();
        let seen = |s: usize| -> f64 {
            let seen = self.followers.seen(action, s).iter();
            seen.map(|(o, z)| z * self.alphas.values(successors[*o])[s])
                .sum()
        };
        let seen: Vec<f64> = (0..states).map(seen).collect();
        (0..states)
            .map(|s| {
                let next = model.moves(s, action).iter();
                let next: f64 = next.map(|(to, p)| p * seen[*to]).sum();
                model.reward(s, action) + model.discount() * next
            })
            .collect()
    }
}
