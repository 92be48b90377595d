//! The fast informed bound.

use super::informed::{ENTRIES_MAX, Mixtures};
use super::{ActionValues, SolveError, mdp};
use crate::budget::Budget;
use crate::model::Pomdp;

/// Q(s,a) = R(s,a) + gamma sum_o max_a' sum_s' T(s,a,s') Z(a,s',o) Q(s',a'); the bound is
/// max_a b·Q(.,a), at most that of Q-MDP (Hauskrecht, JAIR 13, 2000).
///
/// # Errors
/// As of [`mdp::solve_within`], and [`SolveError::Entries`] for tables beyond 20 million entries.
pub fn solve(model: &Pomdp, budget: &mut Budget<'_>) -> Result<ActionValues, SolveError> {
    let relaxed = mdp::solve_within(model, budget)?;
    solve_from(model, &relaxed, budget)
}

/// As [`solve`], with the fully observable relaxation at hand.
///
/// # Errors
/// As of [`solve`].
pub fn solve_from(
    model: &Pomdp,
    relaxed: &mdp::Solution,
    budget: &mut Budget<'_>,
) -> Result<ActionValues, SolveError> {
    let (n, actions) = (model.states().len(), model.actions().len());
    let mut mixtures = Mixtures::new(actions);
    let (mut guess, mut entries) = (Vec::with_capacity(n * actions), 0);
    for s in 0..n {
        for a in 0..actions {
            let successors = model.moves(s, a);
            let mut count = 0;
            for o in 0..model.observations().len() {
                budget.spend(successors.len())?;
                let likelihood = model.likelihood(a, o);
                let before = entries;
                for (to, p) in successors {
                    let w = p * likelihood[*to];
                    if w > 0.0 {
                        mixtures.rows_mut().push(*to, w);
                        entries += 1;
                    }
                }
                if entries > before {
                    mixtures.rows_mut().end_row();
                    count += 1;
                }
            }
            if entries > ENTRIES_MAX {
                return Err(SolveError::Entries(entries));
            }
            mixtures.end_pair(count, model.reward(s, a), model.may_end(s, a));
            guess.push(relaxed.q(s, a));
        }
    }
    let q = mixtures.solve(guess, model.discount(), budget)?;
    let by_action = (0..actions).flat_map(|a| q.iter().skip(a).step_by(actions).copied());
    Ok(ActionValues::new(n, by_action.collect()))
}
