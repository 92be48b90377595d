//! The model's error on runs that it has not seen.

use schemars::JsonSchema;
use serde::Serialize;
use vigil_recording::frames::Run;
use vigil_recording::labels::Label;
use vigil_robot::Description;
use vigil_robot::learned::{Model, MotionModel};

use super::LearnError;
use super::bounds;
use super::motion::{Prediction, follow};
use super::segments::{Segment, Segments};
use crate::bounds::Bounds;

/// A track is judged from this time on after its start, s: before, its innovations tell how well
/// its own beginning was measured, whatever the model.
const SETTLED_S: f64 = 1.0;
/// Residual that a model should not exceed, relative to the sensor's noise.
pub const RESIDUAL_BAR: f64 = 1.1;

/// Root mean square error of one quantity predicted one interval ahead.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, JsonSchema)]
pub struct Residual {
    /// What was found, m or rad.
    pub rms: f64,
    /// The same relative to the sensor's noise.
    pub to_floor: f64,
    /// Standard error of `to_floor`, from the scatter between pieces.
    pub to_floor_error: f64,
    /// What the tracking filter itself predicts for `to_floor`: the sensor's noise plus what it
    /// cannot know, as the ground varies within a run. No method that has learned the variation
    /// rightly does better.
    pub predicted_to_floor: f64,
}

/// Error of one mode's motion model on runs left out, from one second after the start of a track.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct ModeError {
    /// Name of the mode.
    pub mode: String,
    /// Number of pieces of runs.
    pub segments: usize,
    /// Number of poses predicted.
    pub poses: usize,
    /// Root mean square error of the position predicted one interval ahead, per axis, m.
    pub position_rms_m: f64,
    /// The same relative to the sensor's noise.
    pub position_to_floor: f64,
    /// Root mean square error of the yaw predicted one interval ahead, rad.
    pub yaw_rms_rad: f64,
    /// The same relative to the sensor's noise.
    pub yaw_to_floor: f64,
    /// Position in detail, m per axis.
    pub position: Residual,
    /// Yaw in detail, rad.
    pub yaw: Residual,
    /// Yaw in left turns; null without any.
    pub yaw_left: Option<Residual>,
    /// Yaw in right turns; null without any.
    pub yaw_right: Option<Residual>,
    /// Mean log-likelihood of a pose, nats.
    pub log_likelihood: f64,
}

impl ModeError {
    /// True if position and yaw are within [`RESIDUAL_BAR`].
    #[must_use]
    pub fn is_within_bar(&self) -> bool {
        self.position.to_floor.max(self.yaw.to_floor) <= RESIDUAL_BAR
    }
}

/// What learning found.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct Report {
    /// Number of runs learned from.
    pub runs_learned: usize,
    /// Number of runs left out.
    pub runs_held_out: usize,
    /// Nominal driving behind the alarm's calibration, h.
    pub exposure_h: f64,
    /// Error by mode, on the runs left out; empty if none were.
    pub modes: Vec<ModeError>,
    /// Numbers of the model that stand on a bound set by hand, or were not learned.
    pub bounds: Bounds,
}

/// Errors on the `tested` runs.
pub fn report(
    model: &Model,
    tested: &[&Run],
    labels: &[Label],
    robot: &Description,
) -> Result<Report, LearnError> {
    let mut segments = Segments::collect(tested, labels, robot, model)?;
    segments.drop_unmoved();
    let mut modes = Vec::new();
    modes.extend(mode_error(
        model,
        "ND".into(),
        &model.nominal.motion,
        &segments.nominal,
    ));
    for (wheel, stuck) in segments.stuck.iter().enumerate() {
        let Some(learned) = model.stuck(wheel) else {
            continue;
        };
        let mode = format!("{}_STUCK", learned.wheel);
        modes.extend(mode_error(model, mode, &learned.motion, stuck));
    }
    let exposure = model
        .calibration
        .iter()
        .map(|calibration| calibration.exposure_h);
    Ok(Report {
        runs_learned: model.provenance.runs_learned.len(),
        runs_held_out: tested.len(),
        exposure_h: exposure.fold(f64::INFINITY, f64::min),
        modes,
        bounds: bounds::bounds(model, robot),
    })
}

fn mode_error(
    model: &Model,
    mode: String,
    motion: &MotionModel,
    segments: &[Segment],
) -> Option<ModeError> {
    let (mut poses, mut fit) = (0_usize, 0.0);
    let (mut position, mut yaw) = (Vec::new(), Vec::new());
    let mut turns = (Vec::new(), Vec::new());
    for segment in segments {
        let (mut xy, mut heading) = (Squares::default(), Squares::default());
        follow(model, motion, segment, |step| {
            if step.tracked_s < SETTLED_S {
                return;
            }
            poses += 1;
            fit += step.log_likelihood;
            xy.add(step, 0);
            xy.add(step, 1);
            heading.add(step, 2);
        });
        position.push(xy);
        yaw.push(heading);
        let curvature: f64 = segment.iter().map(|o| o.command[0]).sum();
        if curvature > 0.0 {
            turns.0.push(heading);
        } else if curvature < 0.0 {
            turns.1.push(heading);
        }
    }
    let (position, yaw) = (residual(&position)?, residual(&yaw)?);
    Some(ModeError {
        mode,
        segments: segments.len(),
        poses,
        position_rms_m: position.rms,
        position_to_floor: position.to_floor,
        yaw_rms_rad: yaw.rms,
        yaw_to_floor: yaw.to_floor,
        position,
        yaw,
        yaw_left: residual(&turns.0),
        yaw_right: residual(&turns.1),
        log_likelihood: fit / poses as f64,
    })
}

/// Sums of squares over one piece.
#[derive(Debug, Clone, Copy, Default)]
struct Squares {
    count: f64,
    found: f64,
    predicted: f64,
    floor: f64,
}

impl Squares {
    fn add(&mut self, step: &Prediction, axis: usize) {
        self.count += 1.0;
        self.found += step.innovation[axis] * step.innovation[axis];
        self.predicted += step.variance[axis];
        self.floor += step.sensor[axis];
    }
}

/// The residual over some pieces; None if they hold nothing.
fn residual(pieces: &[Squares]) -> Option<Residual> {
    let sum = |value: fn(&Squares) -> f64| pieces.iter().map(value).sum::<f64>();
    let (count, floor) = (sum(|s| s.count), sum(|s| s.floor));
    if count == 0.0 {
        return None;
    }
    let share = sum(|s| s.found) / floor;
    // The ratio of two sums over pieces: its variance by the pieces' scatter about it.
    let apart = |s: &Squares| (s.found - share * s.floor) * (s.found - share * s.floor);
    let n = pieces.len() as f64;
    let scatter = pieces.iter().map(apart).sum::<f64>() * n / (n - 1.0).max(1.0);
    Some(Residual {
        rms: (sum(|s| s.found) / count).sqrt(),
        to_floor: share.sqrt(),
        to_floor_error: scatter.sqrt() / floor / (2.0 * share.sqrt()),
        predicted_to_floor: (sum(|s| s.predicted) / floor).sqrt(),
    })
}
