//! What is done in which order: walks, and now and then what serves all beliefs at once.

use super::controller::Edge;
use super::grid::Outside;
use super::occupancy::Plan;
use super::report::{Bracket, EndReason, Options, Progress};
use super::tree::Tree;
use crate::budget::{Budget, StopRequest};
use crate::sparse_beliefs::{BeliefId, sparse};

/// A walk aims at this share of the gap at the start belief.
const TARGET_SHARE: f64 = 0.5;
/// A walk that expands nothing and narrows the gap by less than this share goes in circles.
/// Chosen by hand, as is the next: both decide when a bound is reached, never which.
const STUCK_SHARE: f64 = 1e-4;
/// Rounds at the edge of the graph have this share of the work, at least.
const EDGE_SHARE: f64 = 0.35;
/// What is done now and then pays if it narrows the gap by this share. Chosen by hand, as are the
/// pauses: they decide when a bound is reached, never which.
const PAYS_SHARE: f64 = 0.01;
/// A controller's vectors are kept if one is better by this share of what pays. Smaller fills the
/// memory with vectors that differ by nothing.
const WORTHWHILE_SHARE: f64 = 1e-3;
/// Pauses of what is done now and then, in multiples of what it costs.
const PAUSE_MIN: u64 = 4;
const PAUSE_START: u64 = 8;
const PAUSE_MAX: u64 = 1024;
/// What is not due before something else has happened.
const NEVER: u64 = u64::MAX;
/// Times that a controller is tied anew while it pays: each costs a linear system.
const CONTROLLERS_MAX: usize = 10;
/// Vectors and points below which nothing is pruned. Chosen by hand: so few are cheap to keep.
const ALPHAS_MIN: usize = 32;
const POINTS_MIN: usize = 200;

/// A search at work.
pub(super) struct Search<'m> {
    pub tree: Tree<'m>,
    pub root: BeliefId,
    pub progress: Progress,
    controller: Rhythm,
    improvement: Rhythm,
    grid: Rhythm,
    /// Elementary operations of rounds at the edge of the graph.
    edge_work: u64,
    /// Rounding that the bracket may hold.
    rounding: f64,
    /// Numbers of vectors and of points at which pruning is due.
    alphas_due: usize,
    points_due: usize,
}

/// When something is next due, in elementary operations. Counted, not timed, so that the same
/// model takes the same course.
struct Rhythm {
    due: u64,
    pause: u64,
}

impl Rhythm {
    const fn new() -> Self {
        Self {
            due: 0,
            pause: PAUSE_START,
        }
    }

    /// What pays is done more often.
    fn done(&mut self, began: u64, ended: u64, pays: bool) {
        self.pause = if pays {
            (self.pause / 2).max(PAUSE_MIN)
        } else {
            (self.pause * 2).min(PAUSE_MAX)
        };
        self.due = ended + self.pause * (ended - began);
    }
}

impl<'m> Search<'m> {
    pub(super) fn new(
        mut tree: Tree<'m>,
        rounding: f64,
        budget: &mut Budget<'_>,
    ) -> Result<Self, StopRequest> {
        let root = tree.node(&sparse(tree.model.start()), budget)?;
        let mut search = Self {
            tree,
            root,
            progress: Progress::default(),
            controller: Rhythm::new(),
            improvement: Rhythm {
                due: NEVER,
                ..Rhythm::new()
            },
            grid: Rhythm::new(),
            edge_work: 0,
            rounding,
            alphas_due: ALPHAS_MIN,
            points_due: POINTS_MIN,
        };
        search.note(budget)?;
        Ok(search)
    }

    /// Searches until the gap is small enough, or the budget or the memory ends.
    pub(super) fn run(
        &mut self,
        options: &Options,
        budget: &mut Budget<'_>,
        watch: &mut dyn FnMut(&Progress),
    ) -> EndReason {
        self.tree.bytes_max = options.memory_bytes_max;
        loop {
            watch(&self.progress);
            if self.progress.bracket.gap() <= options.precision {
                return EndReason::Precision;
            }
            if self.tree.bytes() > self.tree.bytes_max {
                return EndReason::Memory;
            }
            if self.round(options, budget).is_err() {
                // What was found until then counts.
                let node = self.tree.nodes[self.root as usize];
                self.progress.bracket.lower = self.progress.bracket.lower.max(node.lower);
                self.progress.bracket.upper = self.progress.bracket.upper.min(node.upper);
                return EndReason::Stopped;
            }
        }
    }

    fn round(&mut self, options: &Options, budget: &mut Budget<'_>) -> Result<(), StopRequest> {
        let before = (self.tree.children.len(), self.progress.bracket.gap());
        let began = budget.spent();
        // A walk follows what is most probable; what is rare is met at the edge.
        let is_edge_due = (self.edge_work as f64) < EDGE_SHARE * began as f64;
        if self.tree.is_thorough || (is_edge_due && self.progress.rounds > 0) {
            self.tree.walk_from_corner(self.root, budget)?;
            self.tree.advance_frontier(self.root, budget)?;
            self.edge_work += budget.spent() - began;
        } else {
            let target = options.precision.max(TARGET_SHARE * before.1);
            self.tree.walk(self.root, target, budget)?;
        }
        self.now_and_then(budget)?;
        self.progress.rounds += 1;
        self.note(budget)?;
        let is_narrower = self.progress.bracket.gap() <= (1.0 - STUCK_SHARE) * before.1;
        self.tree.is_thorough = self.tree.children.len() == before.0 && !is_narrower;
        Ok(())
    }

    fn note(&mut self, budget: &mut Budget<'_>) -> Result<(), StopRequest> {
        let tree = &mut self.tree;
        let bracket = Bracket {
            lower: tree.lower(self.root, budget)?,
            upper: tree.upper(self.root, budget)?,
        };
        assert_narrower(&self.progress.bracket, &bracket, self.rounding);
        self.progress = Progress {
            bracket,
            rounds: self.progress.rounds,
            vectors: tree.alphas.active_count(),
            points: tree.sawtooth.point_count(),
            beliefs: tree.beliefs.len(),
        };
        Ok(())
    }

    /// Ties plans into controllers while that pays and is no large part of the work. Returns the
    /// lower bound then.
    fn tie_controllers(&mut self, pays: f64, budget: &mut Budget<'_>) -> Result<f64, StopRequest> {
        let (tree, root, began) = (&mut self.tree, self.root, budget.spent());
        let mut value = tree.lower(root, budget)?;
        let share = WORTHWHILE_SHARE * pays;
        for _ in 0..CONTROLLERS_MAX {
            let before = value;
            tree.value_controller(root, Plan::Promising, Edge::Best, share, budget)?;
            value = tree.lower(root, budget)?;
            if value - before <= pays {
                tree.value_controller(root, Plan::Held, Edge::Best, share, budget)?;
                tree.value_controller(root, Plan::Promising, Edge::Nearest, share, budget)?;
                value = tree.lower(root, budget)?;
            }
            if value - before <= pays || budget.spent() - began > began / PAUSE_MIN {
                break;
            }
        }
        Ok(value)
    }

    fn now_and_then(&mut self, budget: &mut Budget<'_>) -> Result<(), StopRequest> {
        let (tree, root) = (&mut self.tree, self.root);
        let (lower, upper) = (tree.lower(root, budget)?, tree.upper(root, budget)?);
        let pays = PAYS_SHARE * (upper - lower);
        let began = budget.spent();
        if began >= self.controller.due {
            let value = self.tie_controllers(pays, budget)?;
            let is_better = value - lower > pays;
            self.controller.done(began, budget.spent(), is_better);
            if !is_better && self.improvement.due == NEVER {
                // Only then, and later: it costs more than all that came before.
                self.improvement.due = PAUSE_START * budget.spent();
            }
        }
        let began = budget.spent();
        if began >= self.improvement.due {
            let lower = self.tree.lower(root, budget)?;
            self.tree.improve_held(root, budget)?;
            let is_better = self.tie_controllers(pays, budget)? - lower > pays;
            self.improvement.done(began, budget.spent(), is_better);
        }
        let tree = &mut self.tree;
        let began = budget.spent();
        if began >= self.grid.due {
            tree.lower_all(Outside::Bounds, budget)?;
            if upper - tree.upper(root, budget)? <= pays {
                tree.lower_all(Outside::Points, budget)?;
            }
            let gain = upper - tree.upper(root, budget)?;
            self.grid.done(began, budget.spent(), gain > pays);
        }
        if tree.alphas.active_count() > self.alphas_due {
            tree.prune_alphas(budget)?;
            self.alphas_due = (tree.alphas.active_count() * 3 / 2).max(ALPHAS_MIN);
        }
        if tree.sawtooth.point_count() > self.points_due {
            tree.prune_points(budget)?;
            self.points_due = (tree.sawtooth.point_count() * 3 / 2).max(POINTS_MIN);
        }
        Ok(())
    }
}

/// Both bounds hold, so that they cross by rounding alone; what is known is never forgotten.
fn assert_narrower(before: &Bracket, after: &Bracket, rounding: f64) {
    assert!(
        after.lower <= after.upper + 4.0 * rounding,
        "the solver's lower bound does not exceed the upper one: {after:?}"
    );
    assert!(
        after.lower >= before.lower && after.upper <= before.upper,
        "the solver's gap does not grow: {before:?}, {after:?}"
    );
}

#[cfg(test)]
mod tests {
    use super::*;

    const BEFORE: Bracket = Bracket {
        lower: 1.0,
        upper: 2.0,
    };

    #[test]
    #[should_panic(expected = "the solver's lower bound does not exceed the upper one")]
    fn bounds_that_cross_are_caught() {
        let crossed = |lower| Bracket { lower, ..BEFORE };
        assert_narrower(&BEFORE, &crossed(2.0), 0.0);
        assert_narrower(&BEFORE, &crossed(2.1), 0.02);
    }

    #[test]
    #[should_panic(expected = "the solver's gap does not grow")]
    fn a_gap_that_grows_is_caught() {
        assert_narrower(&Bracket::default(), &BEFORE, 0.0);
        let wider = Bracket {
            upper: 2.5,
            ..BEFORE
        };
        assert_narrower(&BEFORE, &wider, 1.0);
    }
}
