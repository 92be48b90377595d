//! Displacement per commanded metre: polynomials by least squares, noise by maximum likelihood.

use std::collections::BTreeSet;

use nalgebra::{Matrix3, Vector3};
use vigil_inference::angle::wrap;
use vigil_inference::track::{Displacement, Track};
use vigil_robot::learned::{Curve, Model, MotionModel, Observation};

use super::bounds::{CORRELATION_MAX, DEVIATION_SD, LATERAL_SD, LENGTH_M, OFFSET_SD, WHITE_SD};
use super::least_squares::LeastSquares;
use super::segments::Segment;
use super::simplex::minimise;
use super::{LearnError, Options, SPEEDS_MIN};
use crate::bounds::Limits;

/// Length of the window over which a displacement is measured, s.
const WINDOW_S: f64 = 2.0;
/// Observations averaged at either end of a window.
const END: usize = 5;
/// Different curvatures that a 4th-order polynomial needs.
const CURVATURES_MIN: usize = 5;
/// Curvature below which a robot drives straight ahead, 1/m.
const STRAIGHT_1_M: f64 = 0.02;
/// Soil scatter per metre assumed for weighting windows against sensor noise: it moves no mean.
const SCATTER: f64 = 0.02;
/// Noise of the lateral motion, which no stuck wheel changes much, as a fraction of the forward's:
/// chosen, as that of the rover's effects (0.013 beside 0.10 m/m).
const LATERAL: f64 = 0.15;
/// Segments to which the noise is fitted at most: more add time, not precision.
const SEGMENTS_MAX: usize = 120;

/// Fits the motion of one mode to its pieces of runs.
///
/// # Errors
/// [`LearnError`] if the pieces do not determine the polynomials.
pub fn fit(
    model: &Model,
    segments: &[Segment],
    mode: &str,
    options: &Options,
) -> Result<MotionModel, LearnError> {
    let steps = windows(segments);
    if steps.is_empty() {
        return Err(LearnError::Missing {
            mode: mode.to_owned(),
            missing: "pose in motion",
        });
    }
    let curvatures: BTreeSet<i64> = steps
        .iter()
        .map(|step| (step.curvature * 100.0).round() as i64)
        .collect();
    if curvatures.len() < CURVATURES_MIN {
        let (found, needed) = (curvatures.len(), CURVATURES_MIN);
        return Err(LearnError::Curvatures {
            mode: mode.to_owned(),
            found,
            needed,
        });
    }
    check_range(&steps, mode)?;
    let singular = || LearnError::Singular {
        mode: mode.to_owned(),
        what: "polynomial",
    };
    let noise = &model.noise;
    let mut curves = [Curve::default(); 3];
    for (axis, curve) in curves.iter_mut().enumerate() {
        let sd = if axis == 0 {
            noise.yaw_rad
        } else {
            noise.position_m
        };
        let mut fit = LeastSquares::<{ Curve::TERMS }>::default();
        for step in &steps {
            let sensor = 2.0 * sd * sd / END as f64 / (step.travel * step.travel);
            let weight = 1.0 / (sensor + SCATTER * SCATTER);
            fit.push(
                Curve::basis(step.curvature, step.speed),
                step.per_metre[axis],
                weight,
            );
        }
        *curve = Curve::from_terms(fit.solve().ok_or_else(singular)?);
    }
    let motion = MotionModel {
        yaw: curves[0],
        forward: curves[1],
        lateral: curves[2],
        ..model.nominal.motion
    };
    Ok(fit_noise(model, &motion, segments, options))
}

/// Refuses driving that does not determine the odd terms or the effect of speed.
fn check_range(steps: &[Window], mode: &str) -> Result<(), LearnError> {
    let left = steps.iter().any(|step| step.curvature > STRAIGHT_1_M);
    let right = steps.iter().any(|step| step.curvature < -STRAIGHT_1_M);
    if left != right {
        let (mode, side) = (mode.to_owned(), if left { "left" } else { "right" });
        return Err(LearnError::OneSide { mode, side });
    }
    let speeds = || steps.iter().map(|step| step.speed.abs());
    let low_m_s = speeds().fold(f64::INFINITY, f64::min);
    let high_m_s = speeds().fold(0.0, f64::max);
    if high_m_s < SPEEDS_MIN * low_m_s {
        let mode = mode.to_owned();
        return Err(LearnError::Speeds {
            mode,
            low_m_s,
            high_m_s,
        });
    }
    Ok(())
}

/// One measured displacement.
struct Window {
    curvature: f64,
    speed: f64,
    travel: f64,
    per_metre: [f64; 3],
}

fn windows(segments: &[Segment]) -> Vec<Window> {
    let mut out = Vec::new();
    for segment in segments {
        let mut from = 0;
        while from + END <= segment.len() {
            let mut to = from + END;
            let mut elapsed = 0.0;
            while to < segment.len() && elapsed < WINDOW_S {
                elapsed += segment[to].dt_s;
                to += 1;
            }
            if to - from < 3 * END {
                break;
            }
            out.extend(window(&segment[from..to]));
            from = to - END;
        }
    }
    out
}

/// Displacement between the mean poses of both ends. A chord is shorter than its arc by the
/// factor sin(h)/h, h half the turn: the polynomials describe short steps, so it is undone.
fn window(piece: &[Observation]) -> Option<Window> {
    if piece
        .iter()
        .any(|o| !o.moving || o.anchor || o.pose_frames == 0)
    {
        return None;
    }
    let (head, tail) = (&piece[..END], &piece[piece.len() - END..]);
    let (start, end) = (mean_pose(head), mean_pose(tail));
    let middle = END / 2;
    let inner = &piece[middle + 1..piece.len() - middle];
    let travel: f64 = inner.iter().map(|o| o.travel_m).sum();
    if travel.abs() < 0.02 {
        return None;
    }
    let heading: f64 = inner.iter().map(|o| o.travel_m * o.curvature).sum();
    let speed = inner.iter().map(|o| o.speed).sum::<f64>() / inner.len() as f64;
    // The turn may exceed half a circle only if the steps in between say so.
    let turn: f64 = piece
        .windows(2)
        .map(|two| wrap(two[1].pose[2] - two[0].pose[2]))
        .sum();
    let coarse = wrap(end[2] - start[2]);
    let turn = coarse + (turn - coarse).signum() * whole_turns(turn - coarse);
    let half = 0.5 * turn;
    let arc = if half.abs() > 1e-6 {
        half / half.sin()
    } else {
        1.0
    };
    let (dx, dy) = ((end[0] - start[0]) * arc, (end[1] - start[1]) * arc);
    let (sin, cos) = (start[2] + half).sin_cos();
    let forward = dx * cos + dy * sin;
    let lateral = -dx * sin + dy * cos;
    let per_metre = [turn / travel, forward / travel, lateral / travel];
    Some(Window {
        curvature: heading / travel,
        speed,
        travel,
        per_metre,
    })
}

fn whole_turns(angle: f64) -> f64 {
    (angle.abs() / std::f64::consts::TAU).round() * std::f64::consts::TAU
}

fn mean_pose(piece: &[Observation]) -> [f64; 3] {
    let first = piece[0].pose;
    let count = piece.len() as f64;
    let mean = |axis: usize| -> f64 {
        let apart = |o: &Observation| o.pose[axis] - first[axis];
        let sum: f64 = match axis {
            2 => piece.iter().map(|o| wrap(apart(o))).sum(),
            _ => piece.iter().map(apart).sum(),
        };
        first[axis] + sum / count
    };
    [mean(0), mean(1), mean(2)]
}

/// Maximum likelihood of the tracking filter over offset and coloured deviation of yaw and
/// forward motion, their correlation, the correlation length and white noise.
fn fit_noise(
    model: &Model,
    motion: &MotionModel,
    segments: &[Segment],
    options: &Options,
) -> MotionModel {
    let stride = segments.len().div_ceil(SEGMENTS_MAX).max(1);
    let used: Vec<&Segment> = segments.iter().step_by(stride).collect();
    let start = [-5.0, -5.5, -4.0, -4.5, -1.6, 0.0, -6.0];
    let best = minimise(start, 0.7, options.evaluations, |x| {
        let noise = with_noise(motion, x);
        let fit: f64 = used
            .iter()
            .map(|segment| log_likelihood(model, &noise, segment))
            .sum();
        // A weak pull towards the start keeps directions without data where they are.
        let pull: f64 = x.iter().zip(start).map(|(a, b)| (a - b) * (a - b)).sum();
        0.05 * pull - fit
    });
    with_noise(motion, &best)
}

fn with_noise(motion: &MotionModel, x: &[f64; 7]) -> MotionModel {
    let bounded = |value: f64, limits: &Limits| limits.hold(value.exp());
    let (offset_yaw, offset_forward) = (bounded(x[0], &OFFSET_SD), bounded(x[1], &OFFSET_SD));
    let (yaw, forward) = (bounded(x[2], &DEVIATION_SD), bounded(x[3], &DEVIATION_SD));
    let white = bounded(x[6], &WHITE_SD);
    MotionModel {
        offset_sd: [
            offset_yaw,
            offset_forward,
            OFFSET_SD.hold(LATERAL * offset_forward),
        ],
        deviation_sd: [yaw, forward, LATERAL_SD.hold(LATERAL * forward)],
        deviation_length_m: bounded(x[4], &LENGTH_M),
        correlation: CORRELATION_MAX * x[5].tanh(),
        white_sd: [white, white, white],
        ..*motion
    }
}

/// Log-likelihood of a piece's poses under a motion model.
#[must_use]
pub fn log_likelihood(model: &Model, motion: &MotionModel, segment: &Segment) -> f64 {
    let mut sum = 0.0;
    follow(model, motion, segment, |step| sum += step.log_likelihood);
    sum
}

/// What the tracking filter said of one pose before it saw it, and what it then saw.
#[derive(Debug, Clone, Copy)]
pub struct Prediction {
    /// Time since the track began, s.
    pub tracked_s: f64,
    /// Measured less predicted pose: x m, y m, yaw rad.
    pub innovation: Vector3<f64>,
    /// Its variance by the filter's own account, same order.
    pub variance: [f64; 3],
    /// The sensor's part of that variance.
    pub sensor: [f64; 3],
    /// Log-density of the innovation.
    pub log_likelihood: f64,
}

/// Tracks a piece from its first pose; tells what was predicted of each pose after it.
pub fn follow(
    model: &Model,
    motion: &MotionModel,
    segment: &Segment,
    mut tell: impl FnMut(&Prediction),
) {
    let noise = motion.noise();
    let limit = model.command.curvature_max_1_m;
    let mut track: Option<Track> = None;
    let mut tracked_s = 0.0;
    for observation in segment {
        let sensor = observation.pose_variance(model, [1.0; 3]);
        let Some(track) = track.as_mut().filter(|_| !observation.anchor) else {
            if observation.pose_frames > 0 {
                let spread = Matrix3::from_diagonal(&Vector3::from(sensor));
                tracked_s = 0.0;
                track = Some(Track::new(Vector3::from(observation.pose), spread, &noise));
            }
            continue;
        };
        let step = Displacement {
            per_metre: motion.per_metre(observation.curvature, observation.speed, limit),
            travel_m: observation.travel_m,
            extra: observation.lag_variance(),
        };
        track.predict(&step, &noise);
        tracked_s += observation.dt_s;
        if observation.pose_frames > 0 {
            let (innovation, covariance) = track.innovation(observation.pose, sensor);
            if let Some(log_likelihood) = track.update(observation.pose, sensor) {
                tell(&Prediction {
                    tracked_s,
                    innovation,
                    variance: covariance.diagonal().into(),
                    sensor,
                    log_likelihood,
                });
            }
        }
    }
}
