//! Long plans at once: the plans at reached beliefs, tied into a controller and valued exactly.
//!
//! A backup looks one step ahead, so that near a discount of 1 it would take thousands of rounds
//! until a plan that repeats itself shows its worth. Here the beliefs that the best plan visits
//! become the memory of a finite controller (Hansen, UAI 1998): at each the action of its best
//! vector, then the controller at the belief that follows, or a vector where that is not part of
//! it. Its value is a linear system, less what is left of its error a lower bound everywhere.

use std::collections::HashMap;

use super::alphas::AlphaId;
use super::occupancy::Plan;
use super::tree::Tree;
use crate::bounds::linear::{Rows, System};
use crate::bounds::{SolveError, contraction};
use crate::budget::{Budget, StopRequest};
use crate::sparse_beliefs::{BeliefId, dot};

/// Largest number of matrix entries. Chosen by hand: solving more takes longer than it narrows.
const ENTRIES_MAX: usize = 400_000;

/// Where a plan goes on.
#[derive(Debug, Clone, Copy)]
enum Next {
    Part(u32),
    Vector(AlphaId),
}

/// Beliefs at which a plan is improved at once. Chosen by hand: more take longer than they gain.
const IMPROVED_MAX: usize = 200;

/// Where a plan goes on after a belief that is not part of the controller.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Edge {
    /// With the best vector there.
    Best,
    /// With the part whose belief is most like it. So a plan that goes round and round, but never
    /// through the same belief twice, becomes a circle.
    Nearest,
}

/// The beliefs of a controller, their actions and, for each observation, what goes on.
struct Controller {
    parts: Vec<BeliefId>,
    actions: Vec<usize>,
    next: Vec<Next>,
}

impl Tree<'_> {
    /// Values the controller of a plan from `root`, and adds its vectors where one is better by
    /// more than `worthwhile`.
    pub(super) fn value_controller(
        &mut self,
        root: BeliefId,
        plan: Plan,
        edge: Edge,
        worthwhile: f64,
        budget: &mut Budget<'_>,
    ) -> Result<(), StopRequest> {
        let controller = self.controller(root, plan, edge, budget)?;
        // The root alone may be too large, or its best plan not looked into yet.
        if controller.parts.is_empty() {
            return Ok(());
        }
        let values = match self.controller_values(&controller, budget) {
            Ok(values) => values,
            Err(SolveError::Stopped) => return Err(StopRequest),
            Err(_) => return Ok(()),
        };
        let states = self.model.states().len();
        let is_better = |tree: &Self, part: usize| {
            let belief = tree.beliefs.entries(controller.parts[part]);
            let alpha = &values[part * states..][..states];
            let value = dot(alpha, belief);
            let before = tree.nodes[controller.parts[part] as usize].lower;
            value > before + worthwhile.max(1e-9 * before.abs().max(1e-3))
        };
        let parts = 0..controller.parts.len();
        if !parts.clone().any(|part| is_better(self, part)) {
            return Ok(());
        }
        // All come in, as they name each other; pruning takes out what is not needed.
        let first = self.alphas.len() as AlphaId;
        let observations = self.model.observations().len();
        for part in parts {
            let next = controller.next[part * observations..][..observations].iter();
            let successors: Vec<AlphaId> = next
                .map(|next| match next {
                    Next::Part(part) => first + part,
                    Next::Vector(id) => *id,
                })
                .collect();
            let alpha = &values[part * states..][..states];
            let id = controller.parts[part];
            let origin = (Some(id), self.beliefs.entries(id));
            self.alphas
                .push(origin, controller.actions[part], alpha, &successors);
        }
        Ok(())
    }

    /// One step of planning, by every action, at the beliefs that the held plan visits most.
    pub(super) fn improve_held(
        &mut self,
        root: BeliefId,
        budget: &mut Budget<'_>,
    ) -> Result<(), StopRequest> {
        let mut visited = self.most_visited(root, Plan::Held, budget)?;
        visited.truncate(IMPROVED_MAX);
        let is_thorough = std::mem::replace(&mut self.is_thorough, true);
        for at in visited {
            self.raise_lower(at.id, budget)?;
        }
        self.is_thorough = is_thorough;
        Ok(())
    }

    /// The beliefs that a plan visits most.
    fn controller(
        &mut self,
        root: BeliefId,
        plan: Plan,
        edge: Edge,
        budget: &mut Budget<'_>,
    ) -> Result<Controller, StopRequest> {
        let states = self.model.states().len();
        let observations = self.model.observations().len();
        let visited = self.most_visited(root, plan, budget)?;
        let mut place = HashMap::new();
        let mut parts = Vec::new();
        let mut entries = 0;
        for at in visited {
            let Some(action) = at.action else { continue };
            for s in 0..states {
                entries += self.model.moves(s, action).len() * observations;
            }
            if entries > ENTRIES_MAX {
                break;
            }
            place.insert(at.id, parts.len() as u32);
            parts.push((at.id, action));
        }
        self.tie(parts, &place, edge, budget)
    }

    fn tie(
        &mut self,
        parts: Vec<(BeliefId, usize)>,
        place: &HashMap<BeliefId, u32>,
        edge: Edge,
        budget: &mut Budget<'_>,
    ) -> Result<Controller, StopRequest> {
        let mut next = Vec::new();
        for (id, action) in &parts {
            // What cannot be observed here goes on as what is most probable.
            let mut probable = (0.0, Next::Vector(0));
            let mut go_on = vec![None; self.model.observations().len()];
            for child in self.children_of(*id, *action, budget)? {
                let child = self.children[child];
                let follows = match (place.get(&child.node), edge) {
                    (Some(part), _) => Next::Part(*part),
                    (None, Edge::Nearest) => Next::Part(self.nearest(child.node, &parts, budget)?),
                    (None, Edge::Best) => {
                        self.lower(child.node, budget)?;
                        let witness = self.nodes[child.node as usize].witness;
                        let origin = self.alphas.origin(witness);
                        let part = origin.and_then(|origin| place.get(&origin));
                        part.map_or(Next::Vector(witness), |part| Next::Part(*part))
                    }
                };
                if child.probability > probable.0 {
                    probable = (child.probability, follows);
                }
                go_on[child.observation as usize] = Some(follows);
            }
            next.extend(go_on.into_iter().map(|next| next.unwrap_or(probable.1)));
        }
        let (parts, actions) = parts.into_iter().unzip();
        Ok(Controller {
            parts,
            actions,
            next,
        })
    }

    /// The part whose belief is most like another.
    fn nearest(
        &self,
        id: BeliefId,
        parts: &[(BeliefId, usize)],
        budget: &mut Budget<'_>,
    ) -> Result<u32, StopRequest> {
        let mut dense = vec![0.0; self.model.states().len()];
        for (s, b) in self.beliefs.entries(id) {
            dense[*s as usize] = *b;
        }
        let mut best = (0, 0.0);
        for (at, (part, _)) in parts.iter().enumerate() {
            let entries = self.beliefs.entries(*part);
            // Half the distance of two distributions is 1 less what they share.
            let shared: f64 = entries.iter().map(|(s, b)| b.min(dense[*s as usize])).sum();
            budget.spend(entries.len())?;
            if shared > best.1 {
                best = (at as u32, shared);
            }
        }
        Ok(best.0)
    }

    fn controller_values(
        &self,
        controller: &Controller,
        budget: &mut Budget<'_>,
    ) -> Result<Vec<f64>, SolveError> {
        let model = self.model;
        let (states, observations) = (model.states().len(), model.observations().len());
        let (mut rows, mut right, mut guess) = (Rows::default(), Vec::new(), Vec::new());
        let mut mass_max: f64 = 0.0;
        for (part, action) in controller.actions.iter().enumerate() {
            let next = &controller.next[part * observations..][..observations];
            for s in 0..states {
                let mut reward = model.reward(s, *action);
                let mut mass = 0.0;
                for (o, next) in next.iter().enumerate() {
                    let likelihood = model.likelihood(*action, o);
                    for (to, p) in model.moves(s, *action) {
                        let w = p * likelihood[*to];
                        mass += w;
                        match next {
                            _ if w <= 0.0 => {}
                            Next::Part(part) => rows.push(*part as usize * states + to, w),
                            Next::Vector(id) => {
                                reward += model.discount() * w * self.alphas.values(*id)[*to];
                            }
                        }
                    }
                }
                rows.end_row();
                right.push(reward);
                mass_max = mass_max.max(mass);
                budget.spend(observations * model.moves(s, *action).len())?;
            }
            let witness = self.nodes[controller.parts[part] as usize].witness;
            guess.extend(self.alphas.values(witness));
        }
        let system = System {
            rows: &rows,
            right: &right,
            discount: model.discount(),
        };
        if model.discount() >= 1.0 {
            return system.solve_beside(-1.0, guess, budget);
        }
        let mut values = system.solve_roughly(guess, budget)?;
        let short = system
            .residual(&values)
            .into_iter()
            .fold(0.0_f64, |m, r| m.max(-r));
        let error = short / (1.0 - contraction(model.discount(), mass_max)?);
        if !error.is_finite() {
            return Err(SolveError::Unbounded(model.discount()));
        }
        values.iter_mut().for_each(|v| *v -= error);
        Ok(values)
    }
}
