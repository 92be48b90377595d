//! A point-based solver: lower and upper bound of the optimal value, and a policy.
//!
//! Of the family of HSVI2 (Smith and Simmons, UAI 2005) and SARSOP (Kurniawati, Hsu and Lee, RSS
//! 2008): trials walk from the start belief towards where the bounds are furthest apart, and back
//! up both on the way back.

mod alphas;
mod backup;
mod controller;
mod frontier;
mod grid;
mod prune;
mod sawtooth;
mod tree;
mod trial;

use crate::bounds::{SolveError, blind, fib, mdp, tib};
use crate::budget::Budget;
use crate::model::Pomdp;
use alphas::Alphas;
use sawtooth::Sawtooth;
use tree::Tree;

/// What is known of the optimal value at the start belief.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Bracket {
    /// At least this.
    pub lower: f64,
    /// At most this.
    pub upper: f64,
}

impl Bracket {
    /// upper - lower.
    #[must_use]
    pub fn gap(&self) -> f64 {
        self.upper - self.lower
    }
}

/// What the solver aims at.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Options {
    /// Gap at which it ends.
    pub precision: f64,
    /// Memory at which it ends, bytes.
    pub memory_bytes_max: usize,
}

impl Default for Options {
    fn default() -> Self {
        Self {
            precision: 1e-9,
            memory_bytes_max: 4 << 30,
        }
    }
}

/// State of the search.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Progress {
    /// x
    pub bracket: Bracket,
    /// x
    pub trials: usize,
    /// x
    pub alphas: usize,
    /// x
    pub alphas_active: usize,
    /// x
    pub points: usize,
    /// x
    pub beliefs: usize,
    /// x
    pub bytes: usize,
    /// x
    pub depth: usize,
}

/// Solves.
///
/// # Errors
/// [`SolveError`].
pub fn solve(
    model: &Pomdp,
    options: &Options,
    budget: &mut Budget<'_>,
    watch: &mut dyn FnMut(&Progress),
) -> Result<Progress, SolveError> {
    let relaxed = mdp::solve_within(model, budget)?;
    let fast = fib::solve_from(model, &relaxed, budget)?;
    let lower = blind::solve(model, budget)?;
    let tighter = match tib::solve_from(model, &fast, budget) {
        Ok(tib) => Some(tib),
        Err(SolveError::Entries(_)) => None,
        Err(error) => return Err(error),
    };
    let states = model.states().len();
    let alphas = Alphas::new(&lower, states, model.observations().len());
    let sawtooth = Sawtooth::new(fast, states);
    let tree = Tree::new(model, tighter.as_ref(), alphas, sawtooth);
    Ok(trial::search(tree, options, budget, watch)?)
}
