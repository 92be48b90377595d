//! The beliefs in which the state is certain.
//!
//! Upper bounds lie on the planes between them, so that a bound that is loose there is loose
//! everywhere, and a belief that is almost certain is seldom met twice. So these are searched from,
//! too, each as much as the edge of the graph leans on it.

use super::occupancy::Plan;
use super::tree::Tree;
use crate::budget::{Budget, StopRequest};
use crate::sparse_beliefs::BeliefId;

/// States up to which corners are searched from. Chosen by hand: with more, each matters little.
const STATES_MAX: usize = 128;
/// A walk from a corner aims at this share of its gap.
const TARGET_SHARE: f64 = 0.5;
/// A corner is lowered where that takes this share of its gap: all points have to be looked at
/// anew.
const LOWERED_SHARE: f64 = 0.05;

impl Tree<'_> {
    /// Walks from the corner on which the gap at `root` leans most.
    pub(super) fn walk_from_corner(
        &mut self,
        root: BeliefId,
        budget: &mut Budget<'_>,
    ) -> Result<(), StopRequest> {
        let states = self.model.states().len();
        if states > STATES_MAX {
            return Ok(());
        }
        let mut mass = vec![0.0; states];
        for at in self.visited(root, Plan::Promising, budget)? {
            if at.action.is_none() {
                for (s, b) in self.beliefs.entries(at.id) {
                    mass[*s as usize] += at.visits * b;
                }
            }
        }
        let mut best = (0.0, None);
        for (state, mass) in mass.into_iter().enumerate().filter(|(_, mass)| *mass > 0.0) {
            let corner = self.node(&[(state as u32, 1.0)], budget)?;
            let gap = self.gap(corner, budget)?;
            if mass * gap > best.0 {
                best = (mass * gap, Some((state, corner, gap)));
            }
        }
        let Some((state, corner, gap)) = best.1 else {
            return Ok(());
        };
        self.walk(corner, TARGET_SHARE * gap, budget)?;
        let upper = self.upper(corner, budget)?;
        if upper < self.sawtooth.corners()[state] - LOWERED_SHARE * gap {
            self.lower_corner(state, upper, budget)?;
        }
        Ok(())
    }

    /// Lowers the upper bound where the state is certain, and so the planes between.
    pub(super) fn lower_corner(
        &mut self,
        state: usize,
        upper: f64,
        budget: &mut Budget<'_>,
    ) -> Result<(), StopRequest> {
        self.sawtooth.lower_corner(&self.beliefs, state, upper);
        budget.spend(10 * self.sawtooth.point_count())
    }
}
