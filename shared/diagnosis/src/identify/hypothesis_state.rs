//! What a hypothesis of the multiple-hypothesis filter knows.

use vigil_checkpoint::CheckpointValue;
use vigil_inference::track::Track;

use crate::identify::angles::Angles;
use crate::identify::encoders::Encoders;
use crate::identify::rate_offsets::RateOffsets;
use crate::identify::servo_fault::ServoFault;

/// Probability that a robot that may be thrown begins to be, in an observation. Chosen: once in
/// 2.5 s of dragging.
const THROWN: f64 = 0.02;
/// The same of a robot that was thrown in the last one. Chosen by hand: for 2.5 observations on
/// average. Smaller lets a long throw speak against a stuck wheel; larger learns less of the drive.
const THROWN_ON: f64 = 0.6;
/// How far it is thrown, standard deviation of x m, y m, yaw rad. Chosen by hand: a hop by a
/// quarter of the rover's wheel radius, and a turn of 6 degrees. Smaller leaves large throws
/// unexplained; larger makes small ones improbable.
const THROW_SD: [f64; 3] = [0.02, 0.02, 0.1];

/// Continuous state of a hypothesis, and what its encoders do.
#[derive(Debug, Clone, Copy, CheckpointValue)]
pub struct HypothesisState {
    /// Pose and deviations.
    pub track: Track,
    /// Encoders; in the unknown, encoders or wheels.
    pub encoders: Encoders,
    /// With several stuck wheels: what the other wheels' rates are off by.
    pub offsets: RateOffsets,
    /// In the unknown: which steering angles are as commanded.
    pub angles: Angles,
    /// The steering servo that does not do as it is told.
    pub servo: Option<ServoFault>,
    /// How far the pose has jumped, and the deviation of that, m, once it was measured since.
    pub jump_m: Option<(f64, f64)>,
    /// Part of the weight of the unknown: that its departure is material.
    pub log_material: f64,
    /// In a mode that throws the robot: whether it was thrown in the last observation.
    pub was_thrown: bool,
    /// Wheels, as bits, that may still read as before the onset.
    pub fresh: u32,
}

impl HypothesisState {
    /// Conditions on a measured pose; its log-density. If `is_thrown`, the robot may have been
    /// thrown since the last one: the more probable of both is what happened.
    pub fn take_pose(
        &mut self,
        pose: [f64; 3],
        variance: [f64; 3],
        is_thrown: bool,
    ) -> Option<f64> {
        if !is_thrown {
            return self.track.update(pose, variance);
        }
        let p = if self.was_thrown { THROWN_ON } else { THROWN };
        let (before, mut thrown) = (self.track, self.track);
        thrown.diffuse(THROW_SD.map(|sd| sd * sd));
        let drives = self
            .track
            .update(pose, variance)
            .map(|log| log + (1.0 - p).ln());
        let flies = thrown.update(pose, variance).map(|log| log + p.ln());
        self.was_thrown = flies > drives;
        if self.was_thrown {
            // A throw says nothing of how the robot drives.
            self.track = before;
            self.track.anchor(pose, variance);
            return flies;
        }
        drives
    }
}
