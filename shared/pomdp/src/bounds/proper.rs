//! Ways to the goals of a model with discount 1.
//!
//! With discount 1 the values are those of a stochastic shortest path (Bertsekas and Tsitsiklis,
//! Mathematics of Operations Research 16(3), 1991): a policy is proper if it gets from every state
//! to a goal, with probability 1. There must be one, and every other policy must pay for never
//! getting there, without bound. Then policy iteration that begins with a proper policy ends at the
//! one solution. A vector that is no more than its own backup, and nothing at goals, is a lower
//! bound then, one that is no less an upper one: what still goes on is paid for, or comes to an
//! end.

use super::SolveError;
use crate::model::Pomdp;

/// For every state an action that leads nearer to a goal, by the fewest steps: a proper policy.
///
/// # Errors
/// [`SolveError::NoGoal`], [`SolveError::NoWay`].
pub(super) fn shortest(model: &Pomdp) -> Result<Vec<usize>, SolveError> {
    let states = model.states();
    if !(0..states.len()).any(|s| model.is_goal(s)) {
        return Err(SolveError::NoGoal);
    }
    let ways = ways(model, |_, _| true);
    let missing = ways.iter().position(Option::is_none);
    match missing {
        Some(state) => Err(SolveError::NoWay(states[state].clone())),
        None => Ok(ways.into_iter().flatten().collect()),
    }
}

/// Refuses a policy that never ends from some state.
///
/// # Errors
/// [`SolveError::Endless`].
pub(super) fn check(model: &Pomdp, policy: &[usize]) -> Result<(), SolveError> {
    let ways = ways(model, |state, action| policy[state] == action);
    match ways.iter().position(Option::is_none) {
        Some(state) => Err(SolveError::Endless(model.states()[state].clone())),
        None => Ok(()),
    }
}

/// For every state the first action of a shortest way to a goal; none where there is no way.
fn ways(model: &Pomdp, is_allowed: impl Fn(usize, usize) -> bool) -> Vec<Option<usize>> {
    let states = model.states().len();
    let mut ways = vec![None; states];
    let mut before: Vec<Vec<(u32, u32)>> = vec![Vec::new(); states];
    let mut open = std::collections::VecDeque::new();
    for (s, way) in ways.iter_mut().enumerate() {
        if model.is_goal(s) {
            *way = Some(0);
            continue;
        }
        for a in (0..model.actions().len()).filter(|a| is_allowed(s, *a)) {
            let moves = model.moves(s, a);
            for (to, _) in moves {
                before[*to].push((s as u32, a as u32));
            }
            if way.is_none() && model.may_end(s, a) {
                *way = Some(a);
                open.push_back(s);
            }
        }
    }
    while let Some(to) = open.pop_front() {
        for &(s, a) in &before[to] {
            if ways[s as usize].is_none() {
                ways[s as usize] = Some(a as usize);
                open.push_back(s as usize);
            }
        }
    }
    ways
}
