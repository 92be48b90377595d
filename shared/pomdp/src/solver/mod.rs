//! A point-based solver: lower and upper bound of the optimal value, and a policy.
//!
//! Of the family of HSVI2 (Smith and Simmons, UAI 2005) and SARSOP (Kurniawati, Hsu and Lee, RSS
//! 2008): walks go from the start belief towards where the bounds are furthest apart, and back up
//! both on the way back. What is not theirs:
//!
//! - the upper bound begins with the tighter informed bound, and its sawtooth stands on the fast
//!   informed bound (`sawtooth`);
//! - beliefs that were reached twice share a node, know which vectors and points they have seen,
//!   and are never valued by the same one twice (`tree`);
//! - from time to time the best plan is tied into a controller and valued exactly (`controller`),
//!   and the expanded beliefs are valued together (`grid`), so that a discount near 1 does not
//!   slow either bound down;
//! - rounds at the edge of the graph (`frontier`) have a share of the work, and all of it where
//!   walks go round in circles: a walk follows the most probable observation again and again, even
//!   where what is worth knowing is rare.
//!
//! The same model and precision give the same vectors, unless time or memory ended the search.

mod alphas;
mod backup;
mod controller;
mod export;
mod frontier;
mod grid;
mod initial;
mod method;
mod prune;
mod sawtooth;
mod search;
mod tree;
mod trial;

pub use method::{Answer, Method, MethodError, bound};

use crate::alpha_vectors::AlphaVectors;
use crate::bounds::SolveError;
use crate::budget::Budget;
use crate::model::Pomdp;
use alphas::Alphas;
use initial::Initial;
use sawtooth::Sawtooth;
use search::Search;
use tree::Tree;

/// What is known of the optimal value at the start belief.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Bracket {
    /// At least this; minus infinity if nothing is known.
    pub lower: f64,
    /// At most this; infinity if nothing is known.
    pub upper: f64,
}

impl Bracket {
    /// upper - lower.
    #[must_use]
    pub fn gap(&self) -> f64 {
        self.upper - self.lower
    }
}

impl Default for Bracket {
    fn default() -> Self {
        Self {
            lower: f64::NEG_INFINITY,
            upper: f64::INFINITY,
        }
    }
}

/// What the solver aims at.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Options {
    /// Gap at which it ends, in units of reward.
    pub precision: f64,
    /// Memory at which it ends, bytes (of its large tables).
    pub memory_bytes_max: usize,
}

impl Default for Options {
    fn default() -> Self {
        Self {
            precision: 1e-6,
            memory_bytes_max: 4 << 30,
        }
    }
}

/// How far a search is.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Progress {
    /// Of the optimal value at the start belief.
    pub bracket: Bracket,
    /// Walks and other rounds so far.
    pub rounds: usize,
    /// Vectors of the lower bound.
    pub vectors: usize,
    /// Points of the upper bound.
    pub points: usize,
    /// Beliefs reached.
    pub beliefs: usize,
}

/// Why a search ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum EndReason {
    /// The gap is small enough.
    Precision,
    /// The budget ended.
    Stopped,
    /// The memory ended.
    Memory,
}

/// What a search found.
#[derive(Debug, Clone, PartialEq)]
pub struct SearchResult {
    /// Of the optimal value at the start belief.
    pub bracket: Bracket,
    /// How far it came.
    pub progress: Progress,
    /// Why it ended.
    pub ended: EndReason,
    /// The policy; its value at the start belief is at least the lower bound. None if the budget
    /// ended before there was any.
    pub vectors: Option<AlphaVectors>,
}

/// Searches until the gap at the start belief is at most that of `options`, or the budget ends.
/// `watch` sees every round.
///
/// The bracket is widened by what rounding may amount to: about 2e-13 / (1 - discount) of the
/// largest value.
///
/// # Errors
/// [`SolveError::Unbounded`] for a discount of 1 or rewards beyond a double. A budget that ends is
/// not an error.
pub fn solve(
    model: &Pomdp,
    options: &Options,
    budget: &mut Budget<'_>,
    watch: &mut dyn FnMut(&Progress),
) -> Result<SearchResult, SolveError> {
    let mut found = SearchResult {
        bracket: initial::trivial(model),
        progress: Progress::default(),
        ended: EndReason::Stopped,
        vectors: None,
    };
    let initial = Initial::new(model, budget)?;
    initial.narrow(model, &mut found);
    found.progress.bracket = found.bracket;
    let (Some(blind), Some(fast)) = (&initial.blind, &initial.fast) else {
        return Ok(found);
    };
    let states = model.states().len();
    let alphas = Alphas::new(blind, states, model.observations().len());
    let sawtooth = Sawtooth::new(fast.clone(), initial.corners(states));
    let tree = Tree::new(model, initial.tighter.as_ref(), alphas, sawtooth);
    let Ok(mut search) = Search::new(tree, budget) else {
        return Ok(found);
    };
    let outer = found.bracket;
    let rounding = initial.rounding(model);
    let widened = |bracket: &Bracket| Bracket {
        lower: (bracket.lower - rounding).max(outer.lower),
        upper: (bracket.upper + rounding).min(outer.upper),
    };
    let mut watch_widened = |progress: &Progress| {
        let bracket = widened(&progress.bracket);
        watch(&Progress {
            bracket,
            ..*progress
        });
    };
    let inner = Options {
        precision: (options.precision - 2.0 * rounding).max(0.0),
        ..*options
    };
    found.ended = search.run(&inner, budget, &mut watch_widened);
    found.bracket = widened(&search.progress.bracket);
    found.progress = Progress {
        bracket: found.bracket,
        ..search.progress
    };
    if let Ok(vectors) = search.tree.vectors(search.root) {
        found.vectors = Some(vectors);
    }
    Ok(found)
}
