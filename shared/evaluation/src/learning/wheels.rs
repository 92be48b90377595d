//! Wheel rates relative to rolling without slip.

use vigil_robot::Description;
use vigil_robot::learned::RateModel;
use vigil_robot::learned::wheels::rolling_rate;

use super::LearnError;
use super::least_squares::LeastSquares;
use super::segments::Segment;

/// Observations averaged before the fit.
const WINDOW: usize = 20;
/// A ratio is never known better than this.
const RATIO_SD_MIN: f64 = 0.004;

/// Fits the ratio of every wheel's rate as a quadratic in the curvature. A wheel without readings
/// rolls.
///
/// # Errors
/// [`LearnError::Singular`].
pub fn fit(
    robot: &Description,
    segments: &[Segment],
    mode: &str,
) -> Result<Vec<RateModel>, LearnError> {
    (0..robot.wheels.len())
        .map(|wheel| fit_wheel(robot, segments, mode, wheel))
        .collect()
}

fn fit_wheel(
    robot: &Description,
    segments: &[Segment],
    mode: &str,
    wheel: usize,
) -> Result<RateModel, LearnError> {
    let mut fit = LeastSquares::<3>::default();
    let windows: Vec<(f64, f64, f64)> = segments
        .iter()
        .flat_map(|segment| segment.chunks(WINDOW))
        .filter_map(|chunk| ratio(robot, chunk, wheel))
        .collect();
    if windows.is_empty() {
        return Ok(RateModel {
            ratio: [1.0, 0.0, 0.0],
            ratio_sd: 0.05,
        });
    }
    for (curvature, ratio, variance) in &windows {
        fit.push(
            [1.0, *curvature, curvature * curvature],
            *ratio,
            1.0 / (variance + 1e-6),
        );
    }
    let singular = || LearnError::Singular {
        mode: mode.to_owned(),
        what: "wheel rates",
    };
    let terms = fit.solve().ok_or_else(singular)?;
    let (mut sum, mut noise) = (0.0, 0.0);
    for (curvature, ratio, variance) in &windows {
        let expected = terms[0] + curvature * (terms[1] + curvature * terms[2]);
        sum += (ratio - expected) * (ratio - expected);
        noise += variance;
    }
    let variance = (sum - noise) / windows.len() as f64;
    Ok(RateModel {
        ratio: terms,
        ratio_sd: variance.max(0.0).sqrt().max(RATIO_SD_MIN),
    })
}

/// Curvature, ratio of the rates, and the ratio's variance by sensor noise, over one window. The
/// noise is that of differences in the window, so that this needs no model.
fn ratio(
    robot: &Description,
    chunk: &[vigil_robot::learned::Observation],
    wheel: usize,
) -> Option<(f64, f64, f64)> {
    let used: Vec<_> = chunk
        .iter()
        .filter(|o| o.moving && o.wheels[wheel].plain > 0)
        .collect();
    if used.len() < WINDOW / 2 {
        return None;
    }
    let count = used.len() as f64;
    let curvature = used.iter().map(|o| o.command[0]).sum::<f64>() / count;
    let rolling = used
        .iter()
        .map(|o| rolling_rate(robot, wheel, o.command[0], o.command[1]))
        .sum::<f64>();
    let rate = used.iter().map(|o| o.wheels[wheel].mean).sum::<f64>();
    let steps = used
        .windows(2)
        .map(|two| two[1].wheels[wheel].mean - two[0].wheels[wheel].mean);
    let noise = steps.map(|step| step * step).sum::<f64>() / (2.0 * (count - 1.0));
    let rolling = rolling / count;
    if rolling.abs() < 0.05 {
        return None;
    }
    Some((
        curvature,
        rate / count / rolling,
        noise / count / (rolling * rolling),
    ))
}
