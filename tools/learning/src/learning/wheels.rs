//! Wheel rates beside rolling without slip.

use vigil_robot::Description;
use vigil_robot::learned::wheels::{CREEPING_RAD_S, rolling_rate};
use vigil_robot::learned::{Observation, RateModel};

use super::LearnError;
use super::bounds::{RATE_SD, RATE_SD_UNREAD};
use super::least_squares::LeastSquares;
use super::segments::Segment;

/// Observations averaged before the fit.
const WINDOW: usize = 20;
/// How far from 1 a ratio is expected to be: with speeds close together, ratio and droop are all
/// but the same, and this decides. Chosen: radii of wheels are built to some percent.
const RATIO_SD: f64 = 0.02;

/// Fits every wheel's rate: a ratio to rolling, and a droop that is a quadratic in the curvature. A
/// wheel without readings rolls.
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
    let windows: Vec<Window> = segments
        .iter()
        .flat_map(|segment| segment.chunks(WINDOW))
        .filter_map(|chunk| Window::new(robot, chunk, wheel))
        .collect();
    if windows.is_empty() {
        return Ok(RateModel {
            ratio: 1.0,
            droop_rad_s: [0.0; 3],
            rate_sd_rad_s: RATE_SD_UNREAD,
        });
    }
    let mut fit = LeastSquares::<4>::default();
    fit.push([1.0, 0.0, 0.0, 0.0], 1.0, 1.0 / (RATIO_SD * RATIO_SD));
    for window in &windows {
        let floor = RATE_SD.least.0 * RATE_SD.least.0;
        fit.push(window.basis(), window.rate, 1.0 / (window.variance + floor));
    }
    let singular = || LearnError::Singular {
        mode: mode.to_owned(),
        what: "wheel rates",
    };
    let terms = fit.solve().ok_or_else(singular)?;
    let (mut sum, mut noise) = (0.0, 0.0);
    for window in &windows {
        let basis = window.basis();
        let expected: f64 = basis.iter().zip(terms).map(|(basis, c)| basis * c).sum();
        sum += (window.rate - expected) * (window.rate - expected);
        noise += window.variance;
    }
    let variance = (sum - noise) / windows.len() as f64;
    Ok(RateModel {
        ratio: terms[0],
        droop_rad_s: [terms[1], terms[2], terms[3]],
        rate_sd_rad_s: RATE_SD.hold(variance.max(0.0).sqrt()),
    })
}

/// Means over successive observations.
#[derive(Debug, Clone, Copy)]
struct Window {
    curvature: f64,
    /// Rate of rolling without slip, and as read, rad/s.
    rolling: f64,
    rate: f64,
    /// Variance of the rate by the sensor's noise: that of differences in the window, so that this
    /// needs no model.
    variance: f64,
}

impl Window {
    fn new(robot: &Description, chunk: &[Observation], wheel: usize) -> Option<Self> {
        let used: Vec<_> = chunk
            .iter()
            .filter(|o| o.moving && o.wheels[wheel].plain > 0)
            .collect();
        if used.len() < WINDOW / 2 {
            return None;
        }
        let count = used.len() as f64;
        let mean = |of: &dyn Fn(&Observation) -> f64| {
            used.iter().map(|observation| of(observation)).sum::<f64>() / count
        };
        let steps = used
            .windows(2)
            .map(|two| two[1].wheels[wheel].mean - two[0].wheels[wheel].mean);
        let noise = steps.map(|step| step * step).sum::<f64>() / (2.0 * (count - 1.0));
        let rolling = mean(&|o| rolling_rate(robot, wheel, o.command[0], o.command[1]));
        // A creeping wheel carries less than its load at speed, and says nothing of it.
        (rolling.abs() >= CREEPING_RAD_S).then(|| Self {
            curvature: mean(&|o| o.command[0]),
            rolling,
            rate: mean(&|o| o.wheels[wheel].mean),
            variance: noise / count,
        })
    }

    /// What ratio and droop count for.
    fn basis(&self) -> [f64; 4] {
        let (k, against) = (self.curvature, -self.rolling.signum());
        [self.rolling, against, against * k, against * k * k]
    }
}
