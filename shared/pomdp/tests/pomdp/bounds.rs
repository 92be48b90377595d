//! Bounds against the reference values of public models, and against each other.

use vigil_pomdp::bounds::{SolveError, blind, fib, mdp, tib};
use vigil_pomdp::solver::{Method, Options, bound};
use vigil_pomdp::{Budget, Pomdp};

use crate::public;
use crate::public::bounds::BOUNDS;

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
            let is_close = want.is_nan() || (got - want).abs() <= 1e-6 * want.abs() + 1e-11;
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

/// Lower and upper bound by a method, a search in about a millisecond.
fn bracket(method: Method, model: &Pomdp) -> Result<(f64, f64), SolveError> {
    let mut left = 50;
    let mut stop = || {
        left -= 1;
        left == 0
    };
    let mut budget = Budget::new(&mut stop);
    let options = Options::default();
    let found = bound(method, model, &options, &mut budget, &mut |_| ())?;
    let lower = found.lower.unwrap_or(f64::NEG_INFINITY);
    Ok((lower, found.upper.unwrap_or(f64::INFINITY)))
}

#[test]
fn what_is_left_of_an_error_never_puts_a_bound_on_the_wrong_side() {
    // State 0 pays 1; from either state to state 1 with probability p. With discount g the value
    // in state 0 is (1 - g p) / (1 - g): with these numbers to the last bit.
    for halvings in 1..=20 {
        for p in (4..64).step_by(6) {
            let (rest, p) = (0.5_f64.powi(halvings), f64::from(p) / 64.0);
            let discount = 1.0 - rest;
            let value = (1.0 - discount * p) / rest;
            let stay = 1.0 - p;
            let text = format!(
                "discount: {discount:?} states: 2 actions: 2 observations: 2 start: 1 0
                T: * : * {stay:?} {p:?} O: * 1 0 0 1 R: * : 0 : * : * 1"
            );
            let model = Pomdp::parse(&text).unwrap();
            for method in Method::ALL {
                let (lower, upper) = bracket(method, &model).unwrap();
                let case = format!("{method}, {discount}, {p}: {lower} {value} {upper}");
                assert!(lower <= value && value <= upper, "{case}");
                let slack = 1e-12 * value / rest + 1e-6;
                let is_far = |bound: f64| bound.is_finite() && (bound - value).abs() > slack;
                assert!(!is_far(lower) && !is_far(upper), "{case}");
            }
        }
    }
}

#[test]
fn values_without_bound_are_refused_and_the_reason_is_given() {
    let of = |discount: &str, row: &str, pay: &str| {
        let text = format!(
            "discount: {discount} states: 2 actions: 2 observations: 2
            T: * : 0 {row} T: * : 1 0 1 O: * uniform R: * : 0 : * : * {pay}"
        );
        Pomdp::parse(&text).unwrap()
    };
    for method in Method::ALL {
        let found = bracket(method, &of("0.9999999999", "0.5000000004 0.5", "5")).unwrap_err();
        let SolveError::Mass(discount, sum) = found.clone() else {
            unreachable!("{method}: {found}");
        };
        assert!(discount == 0.999_999_999_9 && (sum - 1.000_000_000_4).abs() < 1e-14);
        assert!(
            found.to_string().contains("sums to 1.0000000004"),
            "{found}"
        );
        // Such a sum does no harm further from 1, nor does what is mended.
        assert!(bracket(method, &of("0.999999", "0.5000000004 0.5", "5")).is_ok());
        assert!(bracket(method, &of("0.999999", "0.500004 0.500004", "5")).is_ok());
    }
}
