//! What regret is measured from.

use vigil_pomdp::bounds::fib;
use vigil_pomdp::solver::{Options, solve};
use vigil_pomdp::{Budget, Pomdp};

use super::Args;
use vigil_terminal::CommandError;

/// Work of the search, in questions of some 20 us to its budget: about half a second. Counted, not
/// timed, so that the same comparison gives the same regret.
const QUESTIONS: usize = 25_000;
/// Gap at which the search ends before, as a share of the bound.
const PRECISION_SHARE: f64 = 1e-3;

/// An upper bound of the value at the start belief.
pub struct Upper {
    /// The bound, reward.
    pub value: f64,
    /// Where it is from.
    pub from: &'static str,
}

/// The bound that was given, or the lower one of the point-based solver's and the fast informed
/// bound; none for missions that actions end.
pub fn upper(args: &Args, world: &Pomdp) -> Result<Option<Upper>, CommandError> {
    if !args.ends.is_empty() {
        return Ok(None);
    }
    if let Some(value) = args.upper {
        let from = "given";
        return Ok(Some(Upper { value, from }));
    }
    let fast = fib::solve(world, &mut Budget::new(&mut || false));
    let fast = fast.map_err(CommandError::usage)?.value(world.start());
    let options = Options {
        precision: PRECISION_SHARE * fast.abs(),
        ..Options::default()
    };
    let mut left = QUESTIONS;
    let mut stop = || {
        left = left.saturating_sub(1);
        left == 0
    };
    let found = solve(world, &options, &mut Budget::new(&mut stop), &mut |_| ());
    let found = found.map_err(CommandError::usage)?.bracket.upper;
    let (value, from) = if found < fast {
        (found, "point-based solver")
    } else {
        (fast, "fast informed bound")
    };
    Ok(Some(Upper { value, from }))
}
