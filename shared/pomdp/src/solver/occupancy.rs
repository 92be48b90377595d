//! How often the beliefs of the graph are visited under a plan.
//!
//! Where a plan goes round in circles, or rests, most of its visits come from beliefs that follow
//! upon each other again and again: near a discount of 1 the sum over all visits is a linear
//! system, not a walk.

use std::cmp::Reverse;
use std::collections::BinaryHeap;
use std::collections::HashMap;

use super::tree::Tree;
use crate::bounds::SolveError;
use crate::bounds::linear::{Rows, System};
use crate::budget::{Budget, StopRequest};
use crate::sparse_beliefs::BeliefId;

/// Beliefs of a plan, at most: the most probable ones. Chosen by hand: more take longer to value
/// than they are worth.
const BELIEFS_MAX: usize = 10_000;

/// Whose actions are taken.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Plan {
    /// Those with the largest upper bound.
    Promising,
    /// Those of the vectors that give the lower bound.
    Held,
}

/// A belief under a plan.
#[derive(Debug, Clone, Copy)]
pub(super) struct Visited {
    pub id: BeliefId,
    /// Discounted number of visits from the root.
    pub visits: f64,
    /// The plan's action; none where it has not been looked into.
    pub action: Option<usize>,
}

impl Tree<'_> {
    /// The action of a plan at a belief, if that has been looked into.
    fn planned(
        &mut self,
        id: BeliefId,
        plan: Plan,
        budget: &mut Budget<'_>,
    ) -> Result<Option<usize>, StopRequest> {
        let Some(first) = self.nodes[id as usize].branches else {
            return Ok(None);
        };
        let first = first as usize;
        let action = match plan {
            Plan::Held => {
                self.lower(id, budget)?;
                self.alphas.action(self.nodes[id as usize].witness)
            }
            Plan::Promising => {
                let mut best = 0;
                for action in 1..self.model.actions().len() {
                    if self.branches[first + action].upper > self.branches[first + best].upper {
                        best = action;
                    }
                }
                best
            }
        };
        let is_known = self.branches[first + action].children.is_some();
        Ok(is_known.then_some(action))
    }

    /// The beliefs that a plan visits from `root`, the most probable first.
    pub(super) fn visited(
        &mut self,
        root: BeliefId,
        plan: Plan,
        budget: &mut Budget<'_>,
    ) -> Result<Vec<Visited>, StopRequest> {
        let mut place = HashMap::new();
        let mut visited: Vec<Visited> = Vec::new();
        // By the probability of one way there; of equal ones the belief that was met first.
        let mut open = BinaryHeap::from([(1.0_f64.to_bits(), Reverse(root))]);
        while let Some((weight, Reverse(id))) = open.pop() {
            if place.contains_key(&id) {
                continue;
            }
            if visited.len() == BELIEFS_MAX {
                break;
            }
            place.insert(id, visited.len());
            let action = self.planned(id, plan, budget)?;
            visited.push(Visited {
                id,
                visits: f64::from_bits(weight),
                action,
            });
            let Some(action) = action else { continue };
            let weight = f64::from_bits(weight) * self.model.discount();
            let children = self.children_of(id, action, budget)?;
            budget.spend(10 * children.len())?;
            for child in &self.children[children] {
                if !place.contains_key(&child.node) {
                    let weight = weight * child.probability;
                    open.push((weight.to_bits(), Reverse(child.node)));
                }
            }
        }
        match self.visits(&visited, &place, budget) {
            Ok(visits) => {
                for (visited, visits) in visited.iter_mut().zip(visits) {
                    visited.visits = visits.max(0.0);
                }
                Ok(visited)
            }
            Err(SolveError::Stopped) => Err(StopRequest),
            // What one way there is worth must do.
            Err(_) => Ok(visited),
        }
    }

    /// The same, those that are visited most first.
    pub(super) fn most_visited(
        &mut self,
        root: BeliefId,
        plan: Plan,
        budget: &mut Budget<'_>,
    ) -> Result<Vec<Visited>, StopRequest> {
        let mut visited = self.visited(root, plan, budget)?;
        visited.sort_by(|a, b| b.visits.total_cmp(&a.visits).then(a.id.cmp(&b.id)));
        Ok(visited)
    }

    /// x = e_root + gamma P^T x.
    fn visits(
        &mut self,
        visited: &[Visited],
        place: &HashMap<BeliefId, usize>,
        budget: &mut Budget<'_>,
    ) -> Result<Vec<f64>, SolveError> {
        let mut before: Vec<Vec<(usize, f64)>> = vec![Vec::new(); visited.len()];
        for (from, at) in visited.iter().enumerate() {
            let Some(action) = at.action else { continue };
            let children = self.children_of(at.id, action, budget)?;
            for child in &self.children[children] {
                if let Some(to) = place.get(&child.node) {
                    before[*to].push((from, child.probability));
                }
            }
        }
        let mut rows = Rows::default();
        for before in &before {
            for (from, p) in before {
                rows.push(*from, *p);
            }
            rows.end_row();
        }
        let mut right = vec![0.0; visited.len()];
        right[0] = 1.0;
        let system = System {
            rows: &rows,
            right: &right,
            discount: self.model.discount(),
        };
        let guess = visited.iter().map(|at| at.visits).collect();
        system.solve_roughly(guess, budget)
    }
}
