//! Which powers of the command a log tells apart.
//!
//! Two speeds tell a line and no curve, however long each was driven. A fit that has a curve's term
//! nevertheless bends it as its ridge likes, holds at these two speeds, and is wrong at all others.

use vigil_robot::channel_model::AXES;
use vigil_robot::channel_model::coverage::product;
use vigil_robot::channel_model::{History, Range, Regressor, Term};

/// Part of what even driving over the whole range would show of a term, from which it counts as
/// told.
const TOLD_MIN: f64 = 0.02;
/// Change of an axis from one observation to the next, relative to its range, above which the
/// second is a mean over a step of the command, and tells of no value that was driven.
const STEP: f64 = 0.1;

/// True if no axis has stepped within the newest observation.
pub(super) fn is_settled(history: &History, ranges: &[Range]) -> bool {
    let (Some(now), Some(last)) = (history.ago(0), history.ago(1)) else {
        return false;
    };
    let axes = ranges.iter().zip(now.command).zip(last.command);
    axes.into_iter()
        .all(|((range, now), last)| (now - last).abs() <= STEP * (range.max - range.min))
}

/// The products of powers among `terms` that these commands do not tell from those of lower order
/// (and from those before them), in order, with all products of which they are a factor; none
/// without commands. Each axis counts from -1 to 1 over its range.
pub(super) fn untold(terms: &[Term], commands: &[[f64; AXES]], ranges: &[Range]) -> Vec<Term> {
    let order = |term: &Term| term.powers.iter().map(|&p| u32::from(p)).sum::<u32>();
    let mut products: Vec<Term> = terms.to_vec();
    products.retain(|term| matches!(term.of, Regressor::Constant | Regressor::Command));
    products.sort_by_key(order);
    let commands: Vec<[f64; AXES]> = commands.iter().map(|c| scaled(c, ranges)).collect();
    let (mut basis, mut untold) = (Vec::<Vec<f64>>::new(), Vec::new());
    if commands.is_empty() {
        return untold;
    }
    for term in products {
        if untold.iter().any(|factor| divides(factor, &term)) {
            untold.push(term);
            continue;
        }
        let mut column: Vec<f64> = commands.iter().map(|c| product(&term.powers, c)).collect();
        for other in &basis {
            let along = mean_product(&column, other);
            let parts = column.iter_mut().zip(other);
            parts.for_each(|(value, other)| *value -= along * other);
        }
        let square = mean_product(&column, &column);
        let even: f64 = term
            .powers
            .iter()
            .map(|&power| even_square(power))
            .product();
        if square < TOLD_MIN * even {
            untold.push(term);
            continue;
        }
        let size = square.sqrt();
        column.iter_mut().for_each(|value| *value /= size);
        basis.push(column);
    }
    untold
}

fn divides(factor: &Term, term: &Term) -> bool {
    let mut powers = factor.powers.iter().zip(&term.powers);
    powers.all(|(factor, power)| factor <= power)
}

/// The axis that a term is, to the first power and alone.
pub(super) fn single(term: &Term) -> Option<usize> {
    let order: u32 = term.powers.iter().map(|&p| u32::from(p)).sum();
    let axis = term.powers.iter().position(|&power| power == 1)?;
    (order == 1).then_some(axis)
}

fn scaled(command: &[f64; AXES], ranges: &[Range]) -> [f64; AXES] {
    let mut out = [0.0; AXES];
    for ((out, value), range) in out.iter_mut().zip(command).zip(ranges) {
        *out = 2.0 * (value - range.min) / (range.max - range.min).max(1e-9) - 1.0;
    }
    out
}

fn mean_product(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>() / a.len().max(1) as f64
}

/// Mean square over -1 to 1 of the Legendre polynomial whose highest power has the factor 1: what
/// even driving leaves of that power beside all lower ones.
fn even_square(power: u8) -> f64 {
    let n = f64::from(power);
    // 2^n n!^2 / (2n)!, factor by factor.
    let factor: f64 = (1..=power)
        .map(|k| f64::from(k) / (n + f64::from(k)))
        .product();
    let highest = 2_f64.powi(i32::from(power)) * factor;
    highest * highest / (2.0 * n + 1.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn range() -> Range {
        Range {
            name: "v".into(),
            unit: "m/s".into(),
            min: 0.2,
            max: 0.5,
            size: 0.5,
            gaps: Vec::new(),
        }
    }

    /// Orders of one axis that are not told by these values, each driven as often.
    fn orders(values: &[f64]) -> Vec<u8> {
        let terms: Vec<Term> = (0..=4).map(|p| Term::command([p, 0, 0, 0])).collect();
        let commands: Vec<_> = values.iter().map(|&v| [v, 0.0, 0.0, 0.0]).collect();
        let untold = untold(&terms, &commands, &[range()]);
        untold.iter().map(|term| term.powers[0]).collect()
    }

    #[test]
    fn as_many_values_as_an_order_has_weights_tell_it_and_no_fewer() {
        assert_eq!(orders(&[0.2, 0.5]), [2, 3, 4]);
        assert_eq!(orders(&[0.2, 0.35, 0.5]), [3, 4]);
        assert_eq!(orders(&[0.2, 0.3, 0.4, 0.5]), [4]);
        assert!(orders(&[0.2, 0.275, 0.35, 0.425, 0.5]).is_empty());
        // Almost two values: the others are too close to them.
        assert_eq!(orders(&[0.2, 0.202, 0.499, 0.5]), [2, 3, 4]);
    }

    #[test]
    fn even_driving_leaves_what_legendres_polynomials_say() {
        let exact = [1.0, 1.0 / 3.0, 4.0 / 45.0, 4.0 / 175.0, 64.0 / 11025.0];
        for (power, exact) in exact.into_iter().enumerate() {
            assert!((even_square(power as u8) - exact).abs() < 1e-15, "{power}");
        }
    }

    #[test]
    fn a_square_that_another_axis_always_equals_is_not_told_from_it() {
        // w = v^2 in the scaled axes: told as w, so not as v^2; v·w is v^3, and told.
        let terms = [[0, 0], [1, 0], [0, 1], [2, 0], [1, 1]];
        let terms = terms.map(|[a, b]| Term::command([a, b, 0, 0]));
        let commands: Vec<_> = (0..=20)
            .map(|i| f64::from(i) / 10.0 - 1.0)
            .map(|u| [0.35 + 0.15 * u, 0.35 + 0.15 * u * u, 0.0, 0.0])
            .collect();
        assert_eq!(untold(&terms, &commands, &[range(), range()]), [terms[3]]);
    }
}
