//! How late a channel is: where its correlation with another is largest.

use super::ImportError;
use super::description::{Delay, LogDescription};
use super::series::Series;
use vigil_learning::correlation;

/// Delays tried: up to this, both ways, s, in such steps.
const DELAY_MAX_S: f64 = 0.5;
const STEP_S: f64 = 0.005;
/// Samples that a correlation needs.
const SAMPLES_MIN: usize = 100;

/// Estimates every delay that is to be estimated, from the beginning of a run.
pub(super) fn estimate(
    log: &LogDescription,
    columns: &[String],
    series: &[Series],
) -> Result<Vec<(String, f64)>, ImportError> {
    let mut out = Vec::new();
    for (channel, late) in log.in_order(columns).zip(series) {
        if channel.delay_s != Delay::Estimate {
            continue;
        }
        let against: Vec<(f64, &Series)> = columns
            .iter()
            .zip(series)
            .filter_map(|(name, series)| Some((*channel.delay_against.get(name)?, series)))
            .collect();
        let delay_s = best(log, late, &against).ok_or_else(|| {
            let message = "its delay cannot be estimated: the channels do not vary together";
            ImportError::description(&channel.name, message)
        })?;
        out.push((channel.name.clone(), delay_s));
    }
    Ok(out)
}

fn best(log: &LogDescription, late: &Series, against: &[(f64, &Series)]) -> Option<f64> {
    let start_s = late.time_s.first()? + DELAY_MAX_S;
    let end_s = late.time_s.last()?.min(start_s + log.estimate_s) - DELAY_MAX_S;
    let count = ((end_s - start_s) * log.rate_hz).floor().max(0.0) as usize;
    if count < SAMPLES_MIN {
        return None;
    }
    let times = |i: usize| start_s + i as f64 / log.rate_hz;
    let sum = |t_s: f64| {
        let terms = against
            .iter()
            .map(|(factor, series)| Some(factor * series.between(t_s)?));
        terms.sum::<Option<f64>>()
    };
    let reference: Vec<Option<f64>> = (0..count).map(|i| sum(times(i))).collect();
    let steps = (DELAY_MAX_S / STEP_S).round() as i32;
    let tried = (-steps..=steps).map(|step| {
        let delay_s = f64::from(step) * STEP_S;
        let pairs = reference.iter().enumerate();
        let pairs = pairs.filter_map(|(i, r)| Some(((*r)?, late.between(times(i) + delay_s)?)));
        (correlation(&pairs.collect::<Vec<_>>()).abs(), delay_s)
    });
    let (found, delay_s) = tried.max_by(|a, b| a.0.total_cmp(&b.0))?;
    (found > 0.3).then_some(delay_s)
}
