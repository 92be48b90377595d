//! Upper bounds of all expanded beliefs at once.
//!
//! A backup carries an improvement one step; near a discount of 1, beliefs that follow upon each
//! other hold each other up for thousands of rounds. Here the expanded beliefs are a decision
//! process of their own, whose other beliefs keep the bounds that they have: its optimal values,
//! found by policy iteration, are upper bounds.

use std::collections::HashMap;

use super::tree::Tree;
use crate::bounds::linear::{Rows, System, largest};
use crate::bounds::{SolveError, contraction, rounding, slacks};
use crate::budget::{Budget, StopRequest};
use crate::sparse_beliefs::BeliefId;

/// Largest number of states with which the corners are part of the process. Chosen by hand.
const CORNERS_MAX: usize = 128;
/// Largest number of links to points and corners. Chosen by hand: some 50 MB.
const LINKS_MAX: usize = 3_000_000;
/// Largest number of beliefs. Chosen: in a larger tree backups alone lower the bounds. Smaller ends
/// this help earlier; larger makes one call take longer.
const BELIEFS_MAX: usize = 6_000;
/// Rounds of policy iteration. Chosen: after any round the bounds hold, as what is left of the
/// error is added to them. Smaller leaves them wider; larger may take longer.
const ROUNDS_MAX: usize = 20;

/// What stands for the beliefs that are not part of the process.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Outside {
    /// The bounds that they have.
    Bounds,
    /// The nearest point and the corners, which are part of it: where a plan goes round and round
    /// but never through the same belief twice, only so its bounds hold each other down.
    Points,
}

/// The process: a choice is one action at one expanded belief.
struct Choices {
    /// First choice of each belief, and the end.
    starts: Vec<usize>,
    /// Of each choice: its reward and what the beliefs outside the process are worth, discounted.
    constants: Vec<f64>,
    /// Of each choice: the beliefs of the process that may follow, with their probabilities.
    links: Rows,
    /// Largest probability with which a choice stays in the process.
    mass_max: f64,
}

impl Choices {
    fn value(&self, choice: usize, discount: f64, values: &[f64]) -> f64 {
        let links = self.links.row(choice).iter();
        let next: f64 = links.map(|(to, p)| p * values[*to as usize]).sum();
        self.constants[choice] + discount * next
    }

    fn best(&self, belief: usize, discount: f64, values: &[f64]) -> (usize, f64) {
        let mut best = (self.starts[belief], f64::NEG_INFINITY);
        for choice in self.starts[belief]..self.starts[belief + 1] {
            let value = self.value(choice, discount, values);
            if value > best.1 {
                best = (choice, value);
            }
        }
        best
    }

    /// Policy iteration with a `bonus` for each choice, from those that are `held`.
    fn improve(
        &self,
        held: &mut [usize],
        discount: f64,
        bonus: f64,
        mut values: Vec<f64>,
        budget: &mut Budget<'_>,
    ) -> Result<Vec<f64>, SolveError> {
        for round in 0..ROUNDS_MAX {
            // A new bonus changes the values of the same choices.
            let mut is_changed = bonus > 0.0 && round == 0;
            for (belief, held) in held.iter_mut().enumerate() {
                let (choice, value) = self.best(belief, discount, &values);
                let is_better = *held == usize::MAX || {
                    let before = self.value(*held, discount, &values);
                    value > before + 1e-13 * before.abs()
                };
                if is_better && choice != *held {
                    *held = choice;
                    is_changed = true;
                }
            }
            budget.spend(self.constants.len())?;
            if !is_changed {
                break;
            }
            let (mut rows, mut right) = (Rows::default(), Vec::new());
            for choice in held.iter() {
                for (to, p) in self.links.row(*choice) {
                    rows.push(*to as usize, *p);
                }
                rows.end_row();
                right.push(self.constants[*choice] + bonus);
            }
            let system = System {
                rows: &rows,
                right: &right,
                discount,
            };
            values = system.solve_roughly(values, budget)?;
        }
        Ok(values)
    }

    /// What the best choice of a belief exceeds its value by, at most.
    fn excess(&self, discount: f64, values: &[f64]) -> f64 {
        let beliefs = values.iter().enumerate();
        let excess = beliefs.map(|(belief, v)| self.best(belief, discount, values).1 - v);
        excess.fold(f64::NEG_INFINITY, f64::max)
    }
}

impl Tree<'_> {
    /// The beliefs of the process: those that are expanded, or, where points stand for what is
    /// outside, the points and the corners alone, by every action that may be the best, unless the
    /// memory ends: what is not expanded keeps its bound.
    fn process(
        &mut self,
        outside: Outside,
        budget: &mut Budget<'_>,
    ) -> Result<Vec<BeliefId>, StopRequest> {
        if outside == Outside::Bounds {
            let all = 0..self.nodes.len() as BeliefId;
            return Ok(all
                .filter(|id| self.nodes[*id as usize].branches.is_some())
                .collect());
        }
        let mut ids: Vec<BeliefId> = self.sawtooth.beliefs().collect();
        for state in 0..self.model.states().len() {
            ids.push(self.node(&[(state as u32, 1.0)], budget)?);
        }
        ids.sort_unstable();
        ids.dedup();
        if ids.len() > BELIEFS_MAX {
            return Ok(ids);
        }
        for id in &ids {
            if self.bytes() > self.bytes_max {
                break;
            }
            let lower = self.lower(*id, budget)?;
            let first = self.branches_of(*id, budget)?;
            for action in 0..self.model.actions().len() {
                if self.branches[first + action].upper > lower {
                    self.children_of(*id, action, budget)?;
                }
            }
        }
        Ok(ids)
    }

    /// Lowers the upper bounds of the process's beliefs to what they allow each other.
    pub(super) fn lower_all(
        &mut self,
        outside: Outside,
        budget: &mut Budget<'_>,
    ) -> Result<(), StopRequest> {
        if outside == Outside::Points && self.model.states().len() > CORNERS_MAX {
            return Ok(());
        }
        let ids = self.process(outside, budget)?;
        if ids.len() > BELIEFS_MAX {
            return Ok(());
        }
        let Some(choices) = self.choices(&ids, outside, budget)? else {
            return Ok(());
        };
        let guess = ids
            .iter()
            .map(|id| self.nodes[*id as usize].upper)
            .collect();
        let values = match self.grid_values(&choices, guess, budget) {
            Ok(values) => values,
            Err(SolveError::Stopped) => return Err(StopRequest),
            Err(_) => return Ok(()),
        };
        for (id, value) in ids.iter().zip(values) {
            let node = &mut self.nodes[*id as usize];
            if value < node.upper - 1e-9 * node.upper.abs() {
                node.upper = value;
                self.sawtooth.put(&self.beliefs, *id, value);
                budget.spend(self.sawtooth.point_count() / 4)?;
            }
        }
        if outside == Outside::Points {
            self.lower_corners(budget)?;
        }
        Ok(())
    }

    /// Takes what is known of certain states into the planes between them.
    fn lower_corners(&mut self, budget: &mut Budget<'_>) -> Result<(), StopRequest> {
        for state in 0..self.model.states().len() {
            let corner = self.node(&[(state as u32, 1.0)], budget)?;
            let upper = self.nodes[corner as usize].upper;
            let before = self.sawtooth.corners()[state];
            if upper < before - 1e-9 * before.abs() {
                self.lower_corner(state, upper, budget)?;
            }
        }
        Ok(())
    }

    /// The process of the expanded beliefs `ids`; none if it is too large. A choice whose children
    /// are not known leads nowhere, and its own upper bound is what it brings.
    fn choices(
        &mut self,
        ids: &[BeliefId],
        outside: Outside,
        budget: &mut Budget<'_>,
    ) -> Result<Option<Choices>, StopRequest> {
        let mut place = vec![u32::MAX; self.nodes.len()];
        for (at, id) in ids.iter().enumerate() {
            place[*id as usize] = at as u32;
        }
        let mut choices = Choices {
            starts: vec![0],
            constants: Vec::new(),
            links: Rows::default(),
            mass_max: 0.0,
        };
        let discount = self.model.discount();
        let mut link_count = 0;
        let mut interpolated = HashMap::new();
        for id in ids {
            let first = self.branches_of(*id, budget)?;
            for branch in first..first + self.model.actions().len() {
                let branch = self.branches[branch];
                let Some((start, count)) = branch.children else {
                    choices.constants.push(branch.upper);
                    choices.links.end_row();
                    continue;
                };
                let mut constant = branch.reward;
                let mut mass = 0.0;
                for at in start..start + count {
                    let child = self.children[at as usize];
                    let known = place.get(child.node as usize).filter(|to| **to != u32::MAX);
                    if let Some(to) = known {
                        choices.links.push(*to as usize, child.probability);
                        mass += child.probability;
                        continue;
                    }
                    if outside == Outside::Bounds {
                        let upper = self.upper(child.node, budget)?;
                        constant += discount * child.probability * upper;
                        continue;
                    }
                    let parts = match interpolated.get(&child.node) {
                        Some(parts) => parts,
                        None => {
                            let parts = self.interpolation(child.node, &place, budget)?;
                            interpolated.entry(child.node).or_insert(parts)
                        }
                    };
                    link_count += parts.len();
                    for (to, weight) in parts {
                        choices.links.push(*to, child.probability * weight);
                        mass += child.probability * weight;
                    }
                    if link_count > LINKS_MAX {
                        return Ok(None);
                    }
                }
                choices.constants.push(constant);
                choices.links.end_row();
                choices.mass_max = choices.mass_max.max(mass);
            }
            choices.starts.push(choices.constants.len());
        }
        Ok(Some(choices))
    }

    /// A belief as a sum of a point's and of corners: places in the process, with weights.
    fn interpolation(
        &mut self,
        id: BeliefId,
        place: &[u32],
        budget: &mut Budget<'_>,
    ) -> Result<Vec<(usize, f64)>, StopRequest> {
        let belief = self.beliefs.entries(id).to_vec();
        let (point, work) = self.sawtooth.closest(&self.beliefs, &belief);
        budget.spend(work)?;
        let at = |id: BeliefId| place.get(id as usize).filter(|at| **at != u32::MAX);
        let mut parts = Vec::new();
        let mut rest: HashMap<u32, f64> = belief.iter().copied().collect();
        if let Some((point, c)) = point
            && let Some(to) = at(point)
        {
            parts.push((*to as usize, c));
            for (s, b) in self.beliefs.entries(point) {
                rest.entry(*s)
                    .and_modify(|rest| *rest = (*rest - c * b).max(0.0));
            }
        }
        for (s, _) in belief {
            let corner = self.node(&[(s, 1.0)], budget)?;
            let to = at(corner);
            assert!(to.is_some(), "corners are part of the process: state {s}");
            let weight = rest.get(&s).copied().unwrap_or(0.0);
            parts.extend(to.map(|to| (*to as usize, weight)));
        }
        Ok(parts)
    }

    fn grid_values(
        &self,
        choices: &Choices,
        mut values: Vec<f64>,
        budget: &mut Budget<'_>,
    ) -> Result<Vec<f64>, SolveError> {
        let discount = self.model.discount();
        let mut held = vec![usize::MAX; values.len()];
        if discount < 1.0 {
            values = choices.improve(&mut held, discount, 0.0, values, budget)?;
            let excess = choices.excess(discount, &values).max(0.0);
            let error = excess / (1.0 - contraction(discount, choices.mass_max)?);
            if !error.is_finite() {
                return Err(SolveError::Unbounded(discount));
            }
            values.iter_mut().for_each(|v| *v += error);
            return Ok(values);
        }
        let error = rounding(choices.links.longest());
        let scale = largest(&values);
        for slack in slacks(discount, error) {
            values = choices.improve(&mut held, discount, slack * scale, values, budget)?;
            if choices.excess(discount, &values) + error * largest(&values) <= 0.0 {
                return Ok(values);
            }
        }
        Err(SolveError::Unbounded(discount))
    }
}

#[cfg(test)]
mod tests {
    use super::super::alphas::Alphas;
    use super::super::blocks::Blocks;
    use super::super::initial::Initial;
    use super::super::sawtooth::Sawtooth;
    use super::*;
    use crate::model::Pomdp;
    use crate::sparse_beliefs::sparse;

    #[test]
    fn points_are_expanded_only_while_there_is_memory() {
        let text = "discount: 0.95 states: a b c actions: 2 observations: 2 T: 0 uniform
            T: 1 : a 0.5 0.25 0.25 T: 1 : b 0 1 0 T: 1 : c 0.25 0.5 0.25
            O: * : a 0.75 0.25 O: * : b 0.5 0.5 O: * : c 0.125 0.875
            R: 0 : a : * : * 1 R: 1 : c : * : * 2";
        let model = Pomdp::parse(text).unwrap();
        let mut stop = || false;
        let budget = &mut Budget::new(&mut stop);
        let grown = |bytes_max: usize, budget: &mut Budget<'_>| {
            let initial = Initial::new(&model, budget).unwrap();
            let (blind, fast) = (
                initial.blind.as_ref().unwrap(),
                initial.fast.clone().unwrap(),
            );
            let blocks = Blocks::new(&model);
            let alphas = Alphas::new(blind, 3, 2, blocks.clone());
            let sawtooth = Sawtooth::new(fast, initial.corners(3), blocks);
            let mut tree = Tree::new(&model, initial.tighter.as_ref(), alphas, sawtooth);
            let root = tree.node(&sparse(model.start()), budget).unwrap();
            tree.walk(root, 0.0, budget).unwrap();
            let before = tree.children.len();
            tree.bytes_max = bytes_max;
            tree.process(Outside::Points, budget).unwrap();
            tree.children.len() - before
        };
        assert_eq!(grown(0, budget), 0);
        assert!(grown(usize::MAX, budget) > 0);
    }
}
