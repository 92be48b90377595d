//! How likely readings of gyro and currents are where something is wrong, over those of a whole
//! robot (natural logarithms).

use vigil_blocks::WHEELS;
use vigil_inference::logspace::{log_add, log_normal};
use vigil_inference::outlier::SPREAD;
use vigil_robot::learned::further_watch::Residual;
use vigil_robot::learned::{Reading, repeats};

/// Share of readings that nothing explains: one observation in 50 s. Chosen by hand: larger weakens
/// each reading, smaller lets a single wrong one decide.
const OUTLIER: f64 = 1e-3;

/// Residuals of the currents that were read, by wheel.
pub(crate) type Currents = [Option<Residual>; WHEELS];

/// The currents without what all have in common: ground and load do that, too.
pub(crate) fn without_common(currents: &Currents) -> Currents {
    let common = mean(currents, |residual, _| residual.apart);
    currents.map(|residual| {
        residual.map(|residual| Residual {
            apart: residual.apart - common,
            ..residual
        })
    })
}

/// Mean over the currents that were read.
fn mean(currents: &Currents, of: impl Fn(&Residual, usize) -> f64) -> f64 {
    let (mut sum, mut count) = (0.0, 0.0);
    for (wheel, residual) in currents.iter().enumerate() {
        if let Some(residual) = residual {
            sum += of(residual, wheel);
            count += 1.0;
        }
    }
    sum / f64::max(count, 1.0)
}

/// Log-density of currents, without what they have in common, if each departs by so much, known up
/// to a deviation, over that of healthy ones.
pub(crate) fn together(beside: &Currents, by: &[f64; WHEELS], sd: impl Fn(f64) -> f64) -> f64 {
    let common_by = mean(beside, |_, wheel| by[wheel]);
    let each = beside.iter().zip(by).filter_map(|(residual, &by)| {
        let (residual, more) = (residual.as_ref()?, sd(by));
        let variance = residual.variance + more * more;
        Some(shifted(residual, by - common_by, variance))
    });
    each.sum()
}

/// Log-density of a residual whose mean is `by` and whose variance is this, over that of a healthy
/// one; now and then each is an outlier.
pub(crate) fn shifted(residual: &Residual, by: f64, variance: f64) -> f64 {
    let density = |apart: f64, variance: f64| {
        let wide = variance * SPREAD * SPREAD;
        log_add(
            log_normal(apart, variance),
            OUTLIER.ln() + log_normal(apart, wide),
        )
    };
    density(residual.apart - by, variance) - density(residual.apart, residual.variance)
}

/// The same for one whose noise is so many times the usual.
pub(crate) fn noisy(residual: &Residual, factor: f64) -> f64 {
    shifted(residual, 0.0, residual.variance * factor * factor)
}

/// The same of all currents, without what they have in common, if the sensor of one wheel is so
/// noisy: then the others tell what is common.
pub(crate) fn noisy_current(beside: &Currents, wheel: usize, factor: f64) -> f64 {
    let Some(own) = &beside[wheel] else {
        return 0.0;
    };
    let others = beside.iter().flatten().count() as f64 - 1.0;
    if others < 1.0 {
        return 0.0;
    }
    let moved = -own.apart / others;
    let each = beside.iter().enumerate().filter_map(|(at, residual)| {
        let residual = residual.as_ref()?;
        let scale = if at == wheel { factor * factor } else { 1.0 };
        Some(shifted(residual, moved, residual.variance * scale))
    });
    each.sum()
}

/// The same for a sensor that repeats itself, most often zero.
pub(crate) fn dead(read: &Reading, residual: Option<Residual>, healthy: f64) -> f64 {
    // The first sample of a dead sensor differs from the last of a living one.
    let is_first = read.plain == 1 && read.zeros > 0;
    match residual.filter(|_| is_first) {
        Some(residual) => {
            let repeats = Reading { plain: 0, ..*read };
            shifted(&residual, -residual.expected, residual.variance)
                + repeats::log_ratio(&repeats, healthy)
        }
        None => repeats::log_ratio(read, healthy),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const VARIANCE: f64 = 0.04;

    fn residual(apart: f64) -> Residual {
        Residual {
            apart,
            variance: VARIANCE,
            expected: 0.7,
            outlier_rate: 1e-3,
        }
    }

    fn is(found: f64, expected: f64) {
        assert!((found - expected).abs() < 1e-12, "{found}, not {expected}");
    }

    /// Logarithm of a normal density, now and then ten times as wide.
    fn log_density(x: f64, variance: f64) -> f64 {
        let normal = |variance: f64| {
            (-0.5 * x * x / variance).exp() / (std::f64::consts::TAU * variance).sqrt()
        };
        (normal(variance) + OUTLIER * normal(100.0 * variance)).ln()
    }

    #[test]
    fn what_all_currents_have_in_common_is_taken_off() {
        let mut currents = [None; WHEELS];
        (currents[0], currents[3]) = (Some(residual(0.5)), Some(residual(0.1)));
        let beside = without_common(&currents);
        is(beside[0].map_or(9.0, |it| it.apart), 0.2);
        is(beside[3].map_or(9.0, |it| it.apart), -0.2);
        assert_eq!(without_common(&[None; WHEELS]), [None; WHEELS]);
    }

    #[test]
    fn a_shift_is_the_ratio_of_two_contaminated_normal_densities() {
        let expected = log_density(0.3 - 0.25, 0.09) - log_density(0.3, VARIANCE);
        is(shifted(&residual(0.3), 0.25, 0.09), expected);
        let expected = log_density(0.3, 9.0 * VARIANCE) - log_density(0.3, VARIANCE);
        is(noisy(&residual(0.3), 3.0), expected);
    }

    #[test]
    fn currents_shift_together_about_their_mean() {
        let mut beside = [None; WHEELS];
        (beside[1], beside[2]) = (Some(residual(0.2)), Some(residual(-0.2)));
        let mut by = [0.0; WHEELS];
        (by[1], by[2]) = (0.5, 0.1);
        let sd = |by: f64| 2.0 * by;
        let expected = shifted(&residual(0.2), 0.2, VARIANCE + 1.0)
            + shifted(&residual(-0.2), -0.2, VARIANCE + 0.04);
        is(together(&beside, &by, sd), expected);
    }

    #[test]
    fn a_noisy_sensor_leaves_what_is_common_to_the_others() {
        let mut beside = [None; WHEELS];
        assert_eq!(noisy_current(&beside, 1, 8.0), 0.0);
        beside[1] = Some(residual(0.6));
        assert_eq!(noisy_current(&beside, 1, 8.0), 0.0, "no other");
        (beside[0], beside[2]) = (Some(residual(-0.3)), Some(residual(-0.3)));
        let expected = shifted(&residual(0.6), -0.3, 64.0 * VARIANCE)
            + 2.0 * shifted(&residual(-0.3), -0.3, VARIANCE);
        is(noisy_current(&beside, 1, 8.0), expected);
    }

    #[test]
    fn the_first_zero_of_a_dead_sensor_differs_from_what_it_read() {
        let read = Reading {
            plain: 1,
            zeros: 3,
            repeats: 2,
            ..Reading::default()
        };
        let repeats = Reading { plain: 0, ..read };
        let jump = shifted(&residual(-0.7), -0.7, VARIANCE);
        let expected = jump + repeats::log_ratio(&repeats, 0.1);
        is(dead(&read, Some(residual(-0.7)), 0.1), expected);
        is(dead(&read, None, 0.1), repeats::log_ratio(&read, 0.1));
        for other in [Reading { plain: 2, ..read }, Reading { zeros: 0, ..read }] {
            let expected = repeats::log_ratio(&other, 0.1);
            is(dead(&other, Some(residual(-0.7)), 0.1), expected);
        }
    }
}
