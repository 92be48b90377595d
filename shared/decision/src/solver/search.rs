//! What is done in which order: walks, and now and then what serves all beliefs at once.

use super::tree::Tree;
use super::{Bracket, Ended, Options, Progress};
use crate::budget::{Budget, Stopped};
use crate::sparse_beliefs::BeliefId;

/// A walk aims at this share of the gap at the start belief.
const TARGET_SHARE: f64 = 0.5;
/// A walk that expands nothing and narrows the gap by less than this share goes in circles.
const STUCK_SHARE: f64 = 1e-4;
/// Of two kinds of rounds each has at least this share of the work.
const SHARE_MIN: f64 = 0.2;
/// What an earlier round brought counts this much less than what the next brings.
const KEPT_SHARE: f64 = 0.7;
/// What is done now and then pays if it narrows the gap by this share.
const PAYS_SHARE: f64 = 0.01;
/// Pauses of what is done now and then, in multiples of what it costs.
const PAUSE_MIN: u64 = 4;
const PAUSE_START: u64 = 8;
const PAUSE_MAX: u64 = 1024;
/// Times that a controller is tied anew while it pays.
const CONTROLLERS_MAX: usize = 10;
/// Vectors and points below which nothing is pruned.
const ALPHAS_MIN: usize = 32;
const POINTS_MIN: usize = 200;

/// A search at work.
pub(super) struct Search<'m> {
    pub tree: Tree<'m>,
    pub root: BeliefId,
    pub progress: Progress,
    controller: Rhythm,
    grid: Rhythm,
    /// Walks, and rounds at the edge of the graph.
    walks: Pace,
    edge: Pace,
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

/// What one kind of round has brought of late, and for which work.
#[derive(Debug, Clone, Copy, Default)]
struct Pace {
    /// Sum of the shares by which the gap became narrower, and of the work: what is older counts
    /// less.
    gain: f64,
    work: f64,
    /// All its work.
    total: u64,
}

impl Pace {
    fn done(&mut self, work: u64, gain: f64) {
        self.gain = KEPT_SHARE * self.gain + gain.max(0.0);
        self.work = KEPT_SHARE * self.work + work as f64;
        self.total += work;
    }

    /// True if this kind of round is next, rather than the `other`: that which brings more for its
    /// work, but none has less than a certain share of it.
    fn is_next(&self, other: &Self) -> bool {
        let all = (self.total + other.total) as f64;
        let is_short = |one: &Self| (one.total as f64) < SHARE_MIN * all;
        let is_quicker = self.gain * other.work >= other.gain * self.work;
        is_short(self) || (is_quicker && !is_short(other))
    }
}

impl<'m> Search<'m> {
    pub(super) fn new(mut tree: Tree<'m>, budget: &mut Budget<'_>) -> Result<Self, Stopped> {
        let start = tree.model.start().iter().enumerate();
        let start: Vec<(u32, f64)> = start
            .filter(|(_, b)| **b > 0.0)
            .map(|(s, b)| (s as u32, *b))
            .collect();
        let root = tree.node(&start, budget)?;
        let mut search = Self {
            tree,
            root,
            progress: Progress::default(),
            controller: Rhythm::new(),
            grid: Rhythm::new(),
            walks: Pace::default(),
            edge: Pace::default(),
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
    ) -> Ended {
        loop {
            watch(&self.progress);
            if self.progress.bracket.gap() <= options.precision {
                return Ended::Precision;
            }
            if self.tree.bytes() > options.memory_bytes_max {
                return Ended::Memory;
            }
            if self.round(options, budget).is_err() {
                // What was found until then counts.
                let node = self.tree.nodes[self.root as usize];
                self.progress.bracket.lower = self.progress.bracket.lower.max(node.lower);
                self.progress.bracket.upper = self.progress.bracket.upper.min(node.upper);
                return Ended::Stopped;
            }
        }
    }

    fn round(&mut self, options: &Options, budget: &mut Budget<'_>) -> Result<(), Stopped> {
        let before = (self.tree.children.len(), self.progress.bracket.gap());
        let began = budget.spent();
        let at_edge = self.tree.is_thorough || self.edge.is_next(&self.walks);
        if at_edge {
            self.tree.advance_frontier(self.root, budget)?;
        } else {
            let target = options.precision.max(TARGET_SHARE * before.1);
            self.tree.walk(self.root, target, budget)?;
        }
        self.now_and_then(budget)?;
        self.progress.rounds += 1;
        self.note(budget)?;
        let gap = self.progress.bracket.gap();
        let pace = if at_edge {
            &mut self.edge
        } else {
            &mut self.walks
        };
        pace.done(budget.spent() - began, (before.1 - gap) / before.1);
        let is_narrower = gap <= (1.0 - STUCK_SHARE) * before.1;
        self.tree.is_thorough = self.tree.children.len() == before.0 && !is_narrower;
        Ok(())
    }

    fn note(&mut self, budget: &mut Budget<'_>) -> Result<(), Stopped> {
        let tree = &mut self.tree;
        self.progress = Progress {
            bracket: Bracket {
                lower: tree.lower(self.root, budget)?,
                upper: tree.upper(self.root, budget)?,
            },
            rounds: self.progress.rounds,
            vectors: tree.alphas.active_count(),
            points: tree.sawtooth.point_count(),
            beliefs: tree.beliefs.len(),
        };
        Ok(())
    }

    fn now_and_then(&mut self, budget: &mut Budget<'_>) -> Result<(), Stopped> {
        let (tree, root) = (&mut self.tree, self.root);
        let (lower, upper) = (tree.lower(root, budget)?, tree.upper(root, budget)?);
        let pays = PAYS_SHARE * (upper - lower);
        let began = budget.spent();
        if began >= self.controller.due {
            let mut value = lower;
            for _ in 0..CONTROLLERS_MAX {
                tree.value_controller(root, budget)?;
                let before = std::mem::replace(&mut value, tree.lower(root, budget)?);
                if value - before <= pays {
                    break;
                }
            }
            self.controller
                .done(began, budget.spent(), value - lower > pays);
        }
        let began = budget.spent();
        if began >= self.grid.due {
            tree.lower_all(budget)?;
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
