//! One walk from the start belief to where the bounds are furthest apart, and back.

use super::tree::Tree;
use crate::budget::{Budget, StopRequest};
use crate::sparse_beliefs::BeliefId;

/// Longest walk: beyond it a discount below 0.99 leaves nothing of a gap, and nearer to 1 the next
/// walk goes on.
const DEPTH_MAX: usize = 200;

impl Tree<'_> {
    /// Walks by the most promising action, and by the observation with the largest share in the
    /// gap beyond `target` (which grows with the depth, as what is far ahead counts less); backs
    /// up both bounds on the way back.
    pub(super) fn walk(
        &mut self,
        root: BeliefId,
        target: f64,
        budget: &mut Budget<'_>,
    ) -> Result<(), StopRequest> {
        let mut path = vec![root];
        let mut node = root;
        let mut allowed = target;
        while path.len() < DEPTH_MAX && self.gap(node, budget)? > allowed {
            let action = self.lower_upper(node, budget)?;
            allowed /= self.model.discount();
            let mut best = (0.0, None);
            for child in self.children_of(node, action, budget)? {
                let child = self.children[child];
                let excess = child.probability * (self.gap(child.node, budget)? - allowed);
                if excess > best.0 {
                    best = (excess, Some(child.node));
                }
            }
            let Some(next) = best.1 else { break };
            node = next;
            path.push(node);
        }
        for node in path.iter().rev() {
            self.lower_upper(*node, budget)?;
            self.raise_lower(*node, budget)?;
        }
        Ok(())
    }
}
