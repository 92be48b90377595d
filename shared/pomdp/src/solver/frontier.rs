//! The unexpanded beliefs that matter most, all over the graph.
//!
//! Near a discount of 1, or where something rare disturbs a state of rest, a walk follows the most
//! probable observation round and round. Here the beliefs at the edge of the most promising plan
//! with the largest share in the gap are expanded: the gap at the root is the sum of theirs, each
//! as often as it is visited.

use super::occupancy::{Plan, Visited};
use super::tree::Tree;
use crate::budget::{Budget, StopRequest};
use crate::sparse_beliefs::BeliefId;

/// Beliefs backed up in one round, and expanded. Chosen by hand: a round stays a small part of
/// the work between two looks at the bounds.
const VISITED_MAX: usize = 1000;
const EXPANDED_MAX: usize = 30;

impl Tree<'_> {
    /// Expands at the edge, then backs up the most probable beliefs, those that are far first.
    pub(super) fn advance_frontier(
        &mut self,
        root: BeliefId,
        budget: &mut Budget<'_>,
    ) -> Result<(), StopRequest> {
        let mut visited = self.visited(root, Plan::Promising, budget)?;
        let mut edge = Vec::new();
        for at in visited.iter().filter(|at| at.action.is_none()) {
            edge.push((at.visits * self.gap(at.id, budget)?, at.id));
        }
        edge.sort_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
        edge.truncate(EXPANDED_MAX);
        visited.retain(|at| at.action.is_some());
        visited.truncate(VISITED_MAX);
        let known = visited.iter().rev().map(|Visited { id, .. }| *id);
        for id in edge.into_iter().map(|(_, id)| id).chain(known) {
            self.lower_upper(id, budget)?;
            self.raise_lower(id, budget)?;
        }
        Ok(())
    }
}
