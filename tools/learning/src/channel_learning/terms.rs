//! From what each channel of a robot is predicted.

use vigil_robot::Description;
use vigil_robot::channel_model::channel::lags;
use vigil_robot::channel_model::observation::SMOOTHING_S;
use vigil_robot::channel_model::{AXES, Model, Quantity, Regressor, Target, Term, drives};

/// Highest power of the command in a motor's part.
const ORDER_MAX: usize = 4;

/// Sets of terms of a channel, each with those of the one before: as a quick robot needs them; with
/// what is slow; with what is slow in one axis and acts through another, as a car turns by its
/// speed and its steering angle.
pub(super) fn candidates(target: &Target, robot: &Description) -> [Vec<Term>; 3] {
    let quick = quick(target, robot);
    let axes = robot.command.len().min(AXES);
    let places = 0..SMOOTHING_S.len();
    let alone: Vec<Term> = places
        .flat_map(|place| (0..axes).map(move |axis| Term::new(Regressor::Smoothed, axis, place)))
        .collect();
    let others = |of: &Term| {
        let of = *of;
        let others = (0..axes).filter(move |&other| other != of.index);
        others.map(move |other| Term {
            powers: std::array::from_fn(|i| u8::from(i == other)),
            ..of
        })
    };
    let through: Vec<Term> = alone.iter().flat_map(others).collect();
    let slow: Vec<Term> = quick.iter().copied().chain(alone).collect();
    let all = slow.iter().copied().chain(through).collect();
    [quick, slow, all]
}

fn quick(target: &Target, robot: &Description) -> Vec<Term> {
    let mut terms = command(robot);
    let axes = robot.command.len().min(AXES);
    for lag in 1..=lags(robot.interval_s) {
        terms.extend((0..axes).map(|axis| Term::new(Regressor::Lagged, axis, lag)));
    }
    let all = drives(robot);
    let own = all
        .iter()
        .position(|drive| drive.wheel.is_some() && drive.wheel == target.wheel);
    match (target.quantity, own) {
        (Quantity::Current, Some(drive)) => terms.push(Term::new(Regressor::Sense, drive, 0)),
        (Quantity::Other | Quantity::Current, _) => {
            terms.extend((0..all.len()).map(|drive| Term::new(Regressor::Sense, drive, 0)));
        }
        _ => {}
    }
    terms
}

/// Products of powers of the command, up to the order that the description gives.
pub(super) fn command(robot: &Description) -> Vec<Term> {
    polynomial(robot.command.len(), robot.polynomial_order.min(ORDER_MAX))
}

/// Every product of powers of the axes up to an order, the constant first.
fn polynomial(axes: usize, order: usize) -> Vec<Term> {
    let mut products = vec![[0_u8; AXES]];
    for axis in 0..axes.min(AXES) {
        let mut more = Vec::new();
        for powers in &products {
            let used: usize = powers.iter().map(|&power| usize::from(power)).sum();
            for power in 0..=order - used.min(order) {
                let mut powers = *powers;
                powers[axis] = power as u8;
                more.push(powers);
            }
        }
        products = more;
    }
    products.into_iter().map(Term::command).collect()
}

/// A term in words; empty for the constant.
pub(super) fn word(term: &Term, model: &Model) -> String {
    let axis = |i: usize| {
        model
            .command
            .get(i)
            .map_or("?", |range| range.name.as_str())
    };
    let of = match term.of {
        Regressor::Constant => return String::new(),
        Regressor::Command => {
            let powers = term
                .powers
                .iter()
                .enumerate()
                .filter(|(_, power)| **power > 0);
            let factors = powers.map(|(i, power)| match power {
                1 => axis(i).to_owned(),
                power => format!("{}^{power}", axis(i)),
            });
            factors.collect::<Vec<_>>().join("*")
        }
        Regressor::Lagged => axis(term.index).to_owned(),
        Regressor::Smoothed => {
            let time_s = SMOOTHING_S[term.lag.min(SMOOTHING_S.len() - 1)];
            let others = Term::command(term.powers);
            return match word(&others, model) {
                others if others.is_empty() => format!("{}[~{time_s} s]", axis(term.index)),
                others => format!("{}[~{time_s} s]*{others}", axis(term.index)),
            };
        }
        Regressor::Sense => format!("sense_{}", term.index),
    };
    match term.lag {
        0 => of,
        lag => format!("{of}[-{lag}]"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_polynomial_has_every_product_once() {
        for (axes, order, count) in [(1, 4, 5), (2, 4, 15), (3, 2, 10), (2, 1, 3)] {
            let terms = polynomial(axes, order);
            assert_eq!(terms.len(), count, "{axes} axes, order {order}");
            assert_eq!(terms[0].of, Regressor::Constant);
            for (i, term) in terms.iter().enumerate() {
                assert!(!terms[..i].contains(term), "{term:?} twice");
            }
        }
    }
}
