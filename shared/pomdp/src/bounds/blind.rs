//! The blind policies: one action for ever, whatever is observed. A lower bound at every belief.
//!
//! With discount 1 an action for ever may never end. Then a policy goes on by lot, which gets to a
//! goal from everywhere: beta = sum_a w_a (R_a + T_a beta) of weights w that are all above 0, and
//! alpha_a = R_a + T_a beta. As sum_a w_a alpha_a is beta, the largest b·alpha_a is no less than
//! b·beta, so that whoever takes the action of the largest again and again earns what it says.

use super::linear::{Rows, System, largest};
use super::{ActionValues, SolveError, contraction, proper, rounding};
use crate::budget::Budget;
use crate::model::Pomdp;

/// alpha_a = (1 - gamma T_a)^-1 R_a for every action a; the bound is max_a b·alpha_a (Hauskrecht,
/// JAIR 13, 2000).
///
/// # Errors
/// As of [`super::mdp::solve_within`].
pub fn solve(model: &Pomdp, budget: &mut Budget<'_>) -> Result<ActionValues, SolveError> {
    if model.discount() >= 1.0 {
        return by_lot(model, budget);
    }
    let n = model.states().len();
    let mut values = Vec::with_capacity(n * model.actions().len());
    for a in 0..model.actions().len() {
        let mut rows = Rows::default();
        for s in 0..n {
            for (to, p) in model.moves(s, a) {
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

/// Weight of an action that is favoured over the others. Chosen by hand: some models need many
/// steps of one action, and few of the others.
const FAVOUR: f64 = 0.75;

/// The policies that begin with one action and go on by lot: of equal lots, and of lots that favour
/// one action, the lot that is best at the start belief.
fn by_lot(model: &Pomdp, budget: &mut Budget<'_>) -> Result<ActionValues, SolveError> {
    proper::shortest(model)?;
    let (n, actions) = (model.states().len(), model.actions().len());
    let worth = |beta: &[f64]| -> f64 { beta.iter().zip(model.start()).map(|(v, b)| v * b).sum() };
    let equal = vec![1.0 / actions as f64; actions];
    let mut best = lot(model, &equal, budget)?;
    for favoured in (0..actions).filter(|_| actions > 1) {
        let mut weights = vec![(1.0 - FAVOUR) / (actions - 1) as f64; actions];
        weights[favoured] = FAVOUR;
        // Values beyond what can be computed are no better.
        let beta = match lot(model, &weights, budget) {
            Err(SolveError::Stopped) => return Err(SolveError::Stopped),
            Err(_) => continue,
            Ok(beta) => beta,
        };
        if worth(&beta) > worth(&best) {
            best = beta;
        }
    }
    let mut values = Vec::with_capacity(n * actions);
    for a in 0..actions {
        values.extend((0..n).map(|s| {
            let moves = model.moves(s, a);
            let next: f64 = moves.iter().map(|(to, p)| p * best[*to]).sum();
            let error = rounding(moves.len()) * largest(&best) * f64::from(u8::from(next != 0.0));
            model.reward(s, a) + next - error
        }));
    }
    if values.iter().any(|v| !v.is_finite()) {
        return Err(SolveError::Unbounded(model.discount()));
    }
    Ok(ActionValues::new(n, values))
}

/// beta of the weights of a lot, no more than the true one.
fn lot(model: &Pomdp, weights: &[f64], budget: &mut Budget<'_>) -> Result<Vec<f64>, SolveError> {
    let n = model.states().len();
    let (mut rows, mut right) = (Rows::default(), Vec::with_capacity(n));
    for s in 0..n {
        let mut reward = 0.0;
        for (a, weight) in weights.iter().enumerate() {
            reward += weight * model.reward(s, a);
            for (to, p) in model.moves(s, a) {
                rows.push(*to, weight * p);
            }
        }
        rows.end_row();
        right.push(reward);
    }
    let system = System {
        rows: &rows,
        right: &right,
        discount: model.discount(),
    };
    system.solve_beside(-1.0, vec![0.0; n], budget)
}
