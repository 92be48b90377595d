//! The blind policies: one action for ever, whatever is observed. A lower bound at every belief.

use super::linear::{Rows, System, largest};
use super::{ActionValues, SolveError, contraction, rounding};
use crate::budget::Budget;
use crate::model::Pomdp;

/// alpha_a = (1 - gamma T_a)^-1 R_a for every action a; the bound is max_a b·alpha_a (Hauskrecht,
/// JAIR 13, 2000).
///
/// # Errors
/// As of [`super::mdp::solve_within`].
pub fn solve(model: &Pomdp, budget: &mut Budget<'_>) -> Result<ActionValues, SolveError> {
    let n = model.states().len();
    let mut values = Vec::with_capacity(n * model.actions().len());
    for a in 0..model.actions().len() {
        let mut rows = Rows::default();
        for s in 0..n {
            for (to, p) in model.successors(s, a) {
                rows.push(*to, *p);
            }
            rows.end_row();
        }
        let right: Vec<f64> = (0..n).map(|s| model.reward(s, a)).collect();
        let system = System {
            rows: &rows,
            right: &right,
            discount: model.discount(),
        };
        let mut alpha = system.solve_roughly(vec![0.0; n], budget)?;
        // A vector that falls short of its own backup by no more than this lies below its value.
        let residual = system.residual(&alpha);
        let short = residual.into_iter().fold(0.0_f64, |m, r| m.max(-r));
        let short = short + rounding(rows.longest()) * largest(&alpha);
        let error = short / (1.0 - contraction(model.discount(), rows.sum_max())?);
        if !error.is_finite() {
            return Err(SolveError::Unbounded(model.discount()));
        }
        alpha.iter_mut().for_each(|v| *v -= error);
        values.extend(alpha);
    }
    Ok(ActionValues::new(n, values))
}
