//! Bounds against the reference values of public models, and against each other.

#![allow(clippy::unwrap_used, missing_docs)]

mod public;

use public::bounds::BOUNDS;
use vigil_decision::bounds::{SolveError, blind, fib, mdp, tib};
use vigil_decision::{Budget, Pomdp};

/// Blind, TIB, FIB, Q-MDP, MDP at the start belief; TIB is NaN where its tables are too large.
fn all(model: &Pomdp) -> [f64; 5] {
    let mut never = || false;
    let mut budget = Budget::new(&mut never);
    let b0 = model.start();
    let relaxed = mdp::solve_within(model, &mut budget).unwrap();
    let fast = fib::solve_from(model, &relaxed, &mut budget).unwrap();
    let tighter = match tib::solve_from(model, &fast, &mut budget) {
        Ok(tib) => tib.value(b0),
        Err(SolveError::Entries(_)) => f64::NAN,
        Err(error) => unreachable!("{error}"),
    };
    let qmdp = (0..model.actions().len())
        .map(|a| b0.iter().zip(relaxed.q_of(a)).map(|(b, q)| b * q).sum())
        .fold(f64::NEG_INFINITY, f64::max);
    let v_mdp = b0
        .iter()
        .enumerate()
        .map(|(s, b)| b * relaxed.value(s))
        .sum();
    let lower = blind::solve(model, &mut budget).unwrap().value(b0);
    [lower, tighter, fast.value(b0), qmdp, v_mdp]
}

#[test]
fn public_models_have_their_reference_bounds() {
    let Some(folder) = public::folder() else {
        return;
    };
    for (name, wanted) in BOUNDS {
        let got = all(&public::read(&folder, name));
        for ((got, want), what) in got
            .iter()
            .zip(wanted)
            .zip(["blind", "TIB", "FIB", "QMDP", "MDP"])
        {
            let is_close = want.is_nan() || (got - want).abs() <= 1e-6 * want.abs() + 1e-12;
            assert!(is_close, "{name}, {what}: {got}, reference {want}");
        }
        for pair in got
            .windows(2)
            .filter(|pair| !pair[0].is_nan() && !pair[1].is_nan())
        {
            assert!(pair[0] <= pair[1] + 1e-9 * pair[1].abs(), "{name}: {got:?}");
        }
    }
}
