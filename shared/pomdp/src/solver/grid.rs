//! Upper bounds of all expanded beliefs at once.
//!
//! A backup carries an improvement one step; near a discount of 1, beliefs that follow upon each
//! other hold each other up for thousands of rounds. Here the expanded beliefs are a decision
//! process of their own, whose other beliefs keep the bounds that they have: its optimal values,
//! found by policy iteration, are upper bounds.

use super::tree::Tree;
use crate::bounds::SolveError;
use crate::bounds::linear::{Rows, System};
use crate::budget::{Budget, StopRequest};
use crate::sparse_beliefs::BeliefId;

/// Largest number of beliefs. Chosen: in a larger tree backups alone lower the bounds. Smaller ends
/// this help earlier; larger makes one call take longer.
const BELIEFS_MAX: usize = 20_000;
/// Rounds of policy iteration. Chosen: after any round the bounds hold, as what is left of the
/// error is added to them. Smaller leaves them wider; larger may take longer.
const ROUNDS_MAX: usize = 20;

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
}

impl Tree<'_> {
    /// Lowers the upper bounds of all expanded beliefs to what they allow each other.
    pub(super) fn lower_all(&mut self, budget: &mut Budget<'_>) -> Result<(), StopRequest> {
        let ids: Vec<BeliefId> = (0..self.nodes.len() as BeliefId)
            .filter(|id| self.nodes[*id as usize].branches.is_some())
            .collect();
        if ids.len() > BELIEFS_MAX {
            return Ok(());
        }
        let choices = self.choices(&ids, budget)?;
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
        Ok(())
    }

    /// The process of the expanded beliefs `ids`. A choice whose children are not known leads
    /// nowhere, and its own upper bound is what it brings.
    fn choices(
        &mut self,
        ids: &[BeliefId],
        budget: &mut Budget<'_>,
    ) -> Result<Choices, StopRequest> {
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
                    match place.get(child.node as usize) {
                        Some(&to) if to != u32::MAX => {
                            choices.links.push(to as usize, child.probability);
                            mass += child.probability;
                        }
                        _ => {
                            let upper = self.upper(child.node, budget)?;
                            constant += discount * child.probability * upper;
                        }
                    }
                }
                choices.constants.push(constant);
                choices.links.end_row();
                choices.mass_max = choices.mass_max.max(mass);
            }
            choices.starts.push(choices.constants.len());
        }
        Ok(choices)
    }

    fn grid_values(
        &self,
        choices: &Choices,
        mut values: Vec<f64>,
        budget: &mut Budget<'_>,
    ) -> Result<Vec<f64>, SolveError> {
        let discount = self.model.discount();
        let mut held = vec![usize::MAX; values.len()];
        for _ in 0..ROUNDS_MAX {
            let mut is_changed = false;
            for (belief, held) in held.iter_mut().enumerate() {
                let (choice, value) = choices.best(belief, discount, &values);
                let is_better = *held == usize::MAX || {
                    let before = choices.value(*held, discount, &values);
                    value > before + 1e-13 * before.abs()
                };
                if is_better && choice != *held {
                    *held = choice;
                    is_changed = true;
                }
            }
            budget.spend(choices.constants.len())?;
            if !is_changed {
                break;
            }
            let (mut rows, mut right) = (Rows::default(), Vec::new());
            for choice in &held {
                for (to, p) in choices.links.row(*choice) {
                    rows.push(*to as usize, *p);
                }
                rows.end_row();
                right.push(choices.constants[*choice]);
            }
            let system = System {
                rows: &rows,
                right: &right,
                discount,
            };
            values = system.solve_roughly(values, budget)?;
        }
        let excess = (0..values.len())
            .map(|belief| choices.best(belief, discount, &values).1 - values[belief])
            .fold(0.0, f64::max);
        let error = excess / (1.0 - discount * choices.mass_max);
        if error.is_nan() || error < 0.0 {
            return Err(SolveError::Unbounded(discount));
        }
        values.iter_mut().for_each(|v| *v += error);
        Ok(values)
    }
}
