//! The model's error on runs that it has not seen.

use serde::Serialize;
use vigil_robot::Description;
use vigil_robot::learned::{Model, MotionModel};

use super::LearnError;
use super::motion::follow;
use super::segments::{Segment, Segments};
use crate::frames::Run;
use crate::labels::Label;

/// Error of one mode's motion model on runs left out.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ModeError {
    /// Mode.
    pub mode: String,
    /// Pieces of runs.
    pub segments: usize,
    /// Poses predicted.
    pub poses: usize,
    /// Root mean square error of the position predicted one interval ahead, per axis, m.
    pub position_rms_m: f64,
    /// The same relative to the sensor's noise.
    pub position_to_floor: f64,
    /// Root mean square error of the yaw predicted one interval ahead, rad.
    pub yaw_rms_rad: f64,
    /// The same relative to the sensor's noise.
    pub yaw_to_floor: f64,
    /// Mean log-likelihood of a pose.
    pub log_likelihood: f64,
}

/// What learning found.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Report {
    /// Runs learned from.
    pub runs_learned: usize,
    /// Runs left out.
    pub runs_held_out: usize,
    /// Nominal driving behind the alarm's calibration, h.
    pub exposure_h: f64,
    /// Error by mode, on the runs left out; empty if none were.
    pub modes: Vec<ModeError>,
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
    })
}

fn mode_error(
    model: &Model,
    mode: String,
    motion: &MotionModel,
    segments: &[Segment],
) -> Option<ModeError> {
    let (mut poses, mut position, mut yaw, mut fit) = (0, 0.0, 0.0, 0.0);
    let mut floor = (0.0, 0.0);
    for segment in segments {
        follow(model, motion, segment, |innovation, log_likelihood| {
            poses += 1;
            position += 0.5 * (innovation[0] * innovation[0] + innovation[1] * innovation[1]);
            yaw += innovation[2] * innovation[2];
            fit += log_likelihood;
        });
        for observation in segment.iter().skip(1) {
            let variance = |sd: f64| {
                let sample = model.sample_variance(sd, observation.frame_s);
                observation.mean_variance(sample, observation.pose_frames)
            };
            floor.0 += variance(model.noise.position_m);
            floor.1 += variance(model.noise.yaw_rad);
        }
    }
    if poses == 0 {
        return None;
    }
    let count = poses as f64;
    Some(ModeError {
        mode,
        segments: segments.len(),
        poses,
        position_rms_m: (position / count).sqrt(),
        position_to_floor: (position / floor.0).sqrt(),
        yaw_rms_rad: (yaw / count).sqrt(),
        yaw_to_floor: (yaw / floor.1).sqrt(),
        log_likelihood: fit / count,
    })
}
