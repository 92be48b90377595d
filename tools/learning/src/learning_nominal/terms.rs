//! Which channels a robot's description allows, and from what each is predicted.

use vigil_robot::Description;
use vigil_robot::nominal::AXES;
use vigil_robot::nominal::{Model, Quantity, Regressor, Target, Term};

/// How many observations back a wheel's rate matters to the gyro and the current.
const WHEEL_LAGS: usize = 3;
/// How many observations back the command matters to what a drive does.
const COMMAND_LAGS: usize = 4;
/// Highest power of the command in a motor's part: beyond this it is friction, which other terms
/// tell.
const ORDER_MAX: usize = 4;

/// Channels with the terms of their predictions.
pub(super) fn targets(robot: &Description) -> Vec<(Target, Vec<Term>)> {
    let mut out = Vec::new();
    let measured = &robot.measured;
    let target = |quantity, wheel| Target { quantity, wheel };
    let polynomial = command(robot);
    if measured.pose {
        for quantity in [Quantity::Forward, Quantity::Lateral, Quantity::Turn] {
            out.push((target(quantity, 0), polynomial.clone()));
        }
    }
    let mut driven = polynomial.clone();
    for lag in 1..COMMAND_LAGS {
        driven.extend((0..robot.command.len()).map(|axis| Term::new(Regressor::Lagged, axis, lag)));
    }
    if measured.yaw_rate {
        let terms = if measured.wheel_rates {
            let mut terms = vec![Term::new(Regressor::Constant, 0, 0)];
            (0..robot.wheels.len()).for_each(|wheel| terms.extend(rates(wheel)));
            terms
        } else {
            driven.clone()
        };
        out.push((target(Quantity::YawRate, 0), terms));
    }
    for wheel in 0..robot.wheels.len() {
        if measured.wheel_rates {
            out.push((target(Quantity::WheelRate, wheel), driven.clone()));
        }
        if measured.currents {
            let mut terms = driven.clone();
            if measured.wheel_rates {
                terms.extend(rates(wheel));
                terms.extend(
                    [Regressor::WheelSpeed, Regressor::WheelSense]
                        .map(|of| Term::new(of, wheel, 0)),
                );
            }
            out.push((target(Quantity::Current, wheel), terms));
        }
    }
    out
}

/// Products of powers of the command, up to the order that the description gives.
pub(super) fn command(robot: &Description) -> Vec<Term> {
    polynomial(robot.command.len(), robot.polynomial_order.min(ORDER_MAX))
}

/// A wheel's last rates.
fn rates(wheel: usize) -> impl Iterator<Item = Term> {
    (0..WHEEL_LAGS).map(move |lag| Term::new(Regressor::Wheel, wheel, lag))
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
    let wheel = model.wheels.get(term.index).map_or("?", String::as_str);
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
        Regressor::Wheel => format!("rate_{wheel}"),
        Regressor::WheelSpeed => format!("|rate_{wheel}|"),
        Regressor::WheelSense => format!("sense_{wheel}"),
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
