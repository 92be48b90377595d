//! How likely readings of gyro and currents are where something is wrong, over those of a whole
//! robot (natural logarithms).

use vigil_blocks::WHEELS;
use vigil_inference::logspace::{log_add, log_normal};
use vigil_inference::outlier::SPREAD;
use vigil_robot::learned::further_watch::Residual;
use vigil_robot::learned::{Reading, repeats};

/// Share of readings that nothing explains: one observation in 50 s.
const OUTLIER: f64 = 1e-3;

/// Mean over the currents that were read.
pub(crate) fn mean(
    currents: &[Option<Residual>; WHEELS],
    of: impl Fn(&Residual, usize) -> f64,
) -> f64 {
    let (mut sum, mut count) = (0.0, 0.0);
    for (wheel, residual) in currents.iter().enumerate() {
        if let Some(residual) = residual {
            sum += of(residual, wheel);
            count += 1.0;
        }
    }
    sum / f64::max(count, 1.0)
}

/// Log-density of the currents if each departs by so much, known up to a deviation, over that of
/// healthy ones. What all have in common is taken off: ground and load do that, too.
pub(crate) fn together(
    currents: &[Option<Residual>; WHEELS],
    by: &[f64; WHEELS],
    sd: impl Fn(f64) -> f64,
) -> f64 {
    let common = mean(currents, |residual, _| residual.apart);
    let common_by = mean(currents, |_, wheel| by[wheel]);
    let each = currents.iter().zip(by).filter_map(|(residual, &by)| {
        let residual = (*residual)?;
        let apart = residual.apart - common;
        let residual = Residual { apart, ..residual };
        let more = sd(by);
        let variance = residual.variance + more * more;
        Some(shifted(&residual, by - common_by, variance))
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

/// The same of all currents if the sensor of one wheel is so noisy: what all have in common the
/// others tell.
pub(crate) fn noisy_current(
    currents: &[Option<Residual>; WHEELS],
    wheel: usize,
    factor: f64,
) -> f64 {
    let Some(own) = &currents[wheel] else {
        return 0.0;
    };
    let common = mean(currents, |residual, _| residual.apart);
    let others = currents.iter().flatten().count() as f64 - 1.0;
    if others < 1.0 {
        return 0.0;
    }
    let moved = (common - own.apart) / others;
    let each = currents.iter().enumerate().filter_map(|(at, residual)| {
        let residual = (*residual)?;
        let scale = if at == wheel { factor * factor } else { 1.0 };
        let apart = residual.apart - common;
        let beside = Residual { apart, ..residual };
        Some(shifted(&beside, moved, residual.variance * scale))
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
