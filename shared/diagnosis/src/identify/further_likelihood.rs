//! How likely readings of gyro and currents are where something is wrong, over those of a whole
//! robot (natural logarithms).

use vigil_blocks::WHEELS;
use vigil_inference::logspace::{log_add, log_normal};
use vigil_inference::outlier::SPREAD;
use vigil_robot::learned::further_watch::Residual;
use vigil_robot::learned::{Reading, repeats};

/// Share of readings that nothing explains: one observation in 50 s.
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
