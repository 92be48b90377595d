//! The unexpanded beliefs that matter most, all over the graph.
//!
//! Near a discount of 1, or where something rare disturbs a state of rest, a walk follows the most
//! probable observation round and round. Here the beliefs that the most promising actions reach are
//! gone through by their probability, and those at the edge with the largest share in the gap are
//! expanded.

use std::collections::HashMap;

use super::controller::heaviest;
use super::tree::Tree;
use crate::budget::{Budget, StopRequest};
use crate::sparse_beliefs::BeliefId;

/// Beliefs gone through in one round, and expanded. Chosen by hand: a round stays a small part of
/// the work between two looks at the bounds.
const VISITED_MAX: usize = 1000;
const EXPANDED_MAX: usize = 30;

impl Tree<'_> {
    /// Expands at the edge, then backs up all beliefs that were gone through.
    pub(super) fn advance_frontier(
        &mut self,
        root: BeliefId,
        budget: &mut Budget<'_>,
    ) -> Result<(), StopRequest> {
        let mut weights = HashMap::from([(root, 1.0)]);
        let mut is_seen = vec![false; self.nodes.len()];
        let (mut visited, mut edge) = (Vec::new(), Vec::new());
        while let Some((id, weight)) = heaviest(&mut weights) {
            budget.spend(weights.len() + 10)?;
            is_seen[id as usize] = true;
            let gap = self.gap(id, budget)?;
            if self.nodes[id as usize].branches.is_none() {
                edge.push((weight * gap, id));
                continue;
            }
            visited.push(id);
            if visited.len() > VISITED_MAX {
                break;
            }
            let first = self.branches_of(id, budget)?;
            let upper = |a: &usize| self.branches[first + a].upper;
            let actions = 0..self.model.actions().len();
            let Some(action) = actions.max_by(|a, b| upper(a).total_cmp(&upper(b))) else {
                continue;
            };
            let Some((start, count)) = self.branches[first + action].children else {
                continue;
            };
            for at in start..start + count {
                let child = self.children[at as usize];
                if !is_seen[child.node as usize] {
                    let share = weight * self.model.discount() * child.probability;
                    *weights.entry(child.node).or_insert(0.0) += share;
                }
            }
        }
        edge.sort_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
        edge.truncate(EXPANDED_MAX);
        let expanded = edge.iter().map(|(_, id)| *id);
        for id in expanded.chain(visited.into_iter().rev()) {
            self.lower_upper(id, budget)?;
            self.raise_lower(id, budget)?;
        }
        Ok(())
    }
}
