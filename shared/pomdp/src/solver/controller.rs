//! Long plans at once: the plans at reached beliefs, tied into a controller and valued exactly.
//!
//! A backup looks one step ahead, so that near a discount of 1 it would take thousands of rounds
//! until a plan that repeats itself shows its worth. Here the beliefs that the best plan visits
//! become the memory of a finite controller (Hansen, UAI 1998): at each the action of its best
//! vector, then the controller at the belief that follows, or a vector where that is not part of
//! it. Its value is a linear system, less what is left of its error a lower bound everywhere.

use std::collections::HashMap;

use super::alphas::{AlphaId, Alphas};
use super::tree::Tree;
use crate::bounds::SolveError;
use crate::bounds::linear::{Rows, System};
use crate::budget::{Budget, StopRequest};
use crate::sparse_beliefs::BeliefId;

/// Largest number of matrix entries. Chosen by hand: solving more takes longer than it narrows.
const ENTRIES_MAX: usize = 400_000;

/// Takes out the belief with the largest weight; of equal ones the lowest, so that the order of a
/// hash table never shows.
pub(super) fn heaviest(weights: &mut HashMap<BeliefId, f64>) -> Option<(BeliefId, f64)> {
    let mut best: Option<(BeliefId, f64)> = None;
    for (&id, &weight) in weights.iter() {
        let is_heavier = best.is_none_or(|(held, most)| {
            weight > most || (weight.to_bits() == most.to_bits() && id < held)
        });
        if is_heavier {
            best = Some((id, weight));
        }
    }
    if let Some((id, _)) = best {
        weights.remove(&id);
    }
    best
}

/// Where a plan goes on.
#[derive(Debug, Clone, Copy)]
enum Next {
    Part(u32),
    Vector(AlphaId),
}

/// The beliefs of a controller, their actions and, for each observation, what goes on.
struct Controller {
    parts: Vec<BeliefId>,
    actions: Vec<usize>,
    next: Vec<Next>,
}

impl Tree<'_> {
    /// Values the controller of the best plan from `root`, and adds its vectors where they are
    /// better.
    pub(super) fn value_controller(
        &mut self,
        root: BeliefId,
        budget: &mut Budget<'_>,
    ) -> Result<(), StopRequest> {
        let controller = self.controller(root, budget)?;
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
            let value: f64 = belief.iter().map(|(s, b)| b * alpha[*s as usize]).sum();
            let before = tree.nodes[controller.parts[part] as usize].lower;
            value > before + 1e-9 * before.abs().max(1e-3)
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
            let origin = Some(controller.parts[part]);
            self.alphas
                .push(origin, controller.actions[part], alpha, &successors);
        }
        Ok(())
    }

    /// The beliefs that the best plan visits, the most probable first.
    fn controller(
        &mut self,
        root: BeliefId,
        budget: &mut Budget<'_>,
    ) -> Result<Controller, StopRequest> {
        let states = self.model.states().len();
        let observations = self.model.observations().len();
        let mut place: HashMap<BeliefId, u32> = HashMap::new();
        let mut parts = Vec::new();
        let mut weights: HashMap<BeliefId, f64> = HashMap::from([(root, 1.0)]);
        let mut entries = 0;
        while let Some((id, weight)) = heaviest(&mut weights) {
            budget.spend(weights.len())?;
            if self.nodes[id as usize].branches.is_none() {
                continue;
            }
            self.lower(id, budget)?;
            let action = self.alphas.action(self.nodes[id as usize].witness);
            let first = self.branches_of(id, budget)?;
            if self.branches[first + action].children.is_none() {
                continue;
            }
            for s in 0..states {
                entries += self.model.successors(s, action).len() * observations;
            }
            if entries > ENTRIES_MAX {
                break;
            }
            place.insert(id, parts.len() as u32);
            parts.push(id);
            for child in self.children_of(id, action, budget)? {
                let child = self.children[child];
                if !place.contains_key(&child.node) {
                    let share = weight * self.model.discount() * child.probability;
                    *weights.entry(child.node).or_insert(0.0) += share;
                }
            }
        }
        self.tie(parts, &place, budget)
    }

    fn tie(
        &mut self,
        parts: Vec<BeliefId>,
        place: &HashMap<BeliefId, u32>,
        budget: &mut Budget<'_>,
    ) -> Result<Controller, StopRequest> {
        let mut controller = Controller {
            actions: Vec::new(),
            next: Vec::new(),
            parts,
        };
        for id in &controller.parts {
            let witness = self.nodes[*id as usize].witness;
            let action = self.alphas.action(witness);
            let successors = self.alphas.successors(witness).iter();
            let go_on = |alphas: &Alphas, id: AlphaId| {
                let part = alphas.origin(id).and_then(|origin| place.get(&origin));
                part.map_or(Next::Vector(id), |part| Next::Part(*part))
            };
            let mut next: Vec<Next> = successors.map(|id| go_on(&self.alphas, *id)).collect();
            for child in self.children_of(*id, action, budget)? {
                let child = self.children[child];
                next[child.observation as usize] = match place.get(&child.node) {
                    Some(part) => Next::Part(*part),
                    None => {
                        self.lower(child.node, budget)?;
                        go_on(&self.alphas, self.nodes[child.node as usize].witness)
                    }
                };
            }
            controller.actions.push(action);
            controller.next.extend(next);
        }
        Ok(controller)
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
                    for (to, p) in model.successors(s, *action) {
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
                budget.spend(observations * model.successors(s, *action).len())?;
            }
            let witness = self.nodes[controller.parts[part] as usize].witness;
            guess.extend(self.alphas.values(witness));
        }
        let system = System {
            rows: &rows,
            right: &right,
            discount: model.discount(),
        };
        let mut values = system.solve_roughly(guess, budget)?;
        let short = system
            .residual(&values)
            .into_iter()
            .fold(0.0_f64, |m, r| m.max(-r));
        let error = short / (1.0 - model.discount() * mass_max);
        if error.is_nan() || error < 0.0 {
            return Err(SolveError::Unbounded(model.discount()));
        }
        values.iter_mut().for_each(|v| *v -= error);
        Ok(values)
    }
}
