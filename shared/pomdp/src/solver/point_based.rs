//! The search from beginning to end.

use super::alphas::Alphas;
use super::blocks::Blocks;
use super::initial::{self, Initial};
use super::report::{Bracket, EndReason, Options, Progress, SearchResult};
use super::sawtooth::Sawtooth;
use super::search::Search;
use super::tree::Tree;
use crate::bounds::SolveError;
use crate::budget::Budget;
use crate::model::Pomdp;

/// Rewards beyond this are refused: with the discount nearest to 1 that a double can be, their sum
/// for ever stays finite, and so does every plan's value.
const REWARD_MAX: f64 = 1e290;

/// Searches until the gap at the start belief is at most that of `options`, or the budget ends.
/// `watch` sees every round.
///
/// The bracket is widened by what rounding may amount to: about 2e-13 / (1 - discount) of the
/// largest value, with discount 1 2e-13 of it for each step to a goal.
///
/// # Errors
/// [`SolveError::Unbounded`] for rewards beyond a double; with discount 1 what a goal problem
/// lacks. A budget that ends is not an error.
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
    if initial::largest_reward(model) > REWARD_MAX {
        return Err(SolveError::Unbounded(model.discount()));
    }
    let initial = Initial::new(model, budget)?;
    initial.narrow(model, &mut found);
    found.progress.bracket = found.bracket;
    let (Some(blind), Some(fast)) = (&initial.blind, &initial.fast) else {
        return Ok(found);
    };
    let states = model.states().len();
    let blocks = Blocks::new(model);
    let alphas = Alphas::new(blind, states, model.observations().len(), blocks.clone());
    let sawtooth = Sawtooth::new(fast.clone(), initial.corners(states), blocks);
    let tree = Tree::new(model, initial.tighter.as_ref(), alphas, sawtooth);
    let rounding = match initial.rounding(model, found.bracket.lower, budget) {
        Err(SolveError::Stopped) => return Ok(found),
        rounding => rounding?,
    };
    let Ok(mut search) = Search::new(tree, rounding, budget) else {
        return Ok(found);
    };
    let outer = found.bracket;
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
