//! The blind policies: one action for ever, whatever is observed. A lower bound at every belief.

use super::linear::{Rows, System};
use super::{ActionValues, SolveError};
use crate::budget::Budget;
use crate::model::Pomdp;

/// alpha_a = (1 - gamma T_a)^-1 R_a for every action a; the bound is max_a b·alpha_a (Hauskrecht,
/// JAIR 13, 2000).
///
/// # Errors
/// [`SolveError`].
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
        values.extend(system.solve(vec![0.0; n], budget)?);
    }
    Ok(ActionValues::new(n, values))
}
