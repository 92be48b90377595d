//! Frames averaged into one observation: what the filters step by.

use vigil_blocks::WHEELS;
use vigil_checkpoint::CheckpointValue;
use vigil_inference::track::Displacement;

use super::troubles::Troubles;
use super::{Model, MotionModel, Reading};

/// Commanded and lagged curvature of a steady drive differ by this at most, 1/m: 0.1 of the most.
const STEADY_1_M: f64 = 0.1;
/// Random motion of a robot that creeps or rests, per observation and axis, as a share of the pose
/// sensor's deviation: its track follows the measured pose, and learns no slope from it.
const RESTS: f64 = 0.1;

/// Frames averaged over about the learned interval.
#[derive(Debug, Clone, Copy, PartialEq, Default, CheckpointValue)]
pub struct Observation {
    /// Capture time of the last frame, ns.
    pub t_ns: u64,
    /// Capture time of the first frame, ns.
    pub t_first_ns: u64,
    /// Time since the observation before, s.
    pub dt_s: f64,
    /// The same from middle to middle of their frames, s.
    pub middles_s: f64,
    /// Period of the frames, s: what the noise of one sample depends on.
    pub frame_s: f64,
    /// Frames averaged.
    pub frames: u32,
    /// Commanded travel since the observation before, from middle to middle, m.
    pub travel_m: f64,
    /// Curvature over that travel, lag included, 1/m.
    pub curvature: f64,
    /// Speed, lag included, m/s.
    pub speed: f64,
    /// Variances of the travel, m², and of its turn, rad², by what is not known of the body's lag.
    pub travel_variance: f64,
    /// See `travel_variance`.
    pub turn_variance: f64,
    /// Command itself, averaged: curvature 1/m, speed m/s.
    pub command: [f64; 2],
    /// Whether the robot was commanded to move: otherwise nothing is evidence.
    pub moving: bool,
    /// Whether the pose has no relation to the one before: start or jump of its frame, or a gap.
    pub anchor: bool,
    /// Frames with a pose; 0: `pose` means nothing.
    pub pose_frames: u32,
    /// Mean pose x, y, yaw.
    pub pose: [f64; 3],
    /// Wheel rates, rad/s.
    pub wheels: [Reading; WHEELS],
    /// Steering angles, rad.
    pub steer: [Reading; WHEELS],
    /// What no filter could tell.
    pub troubles: Troubles,
}

impl Observation {
    /// Variance of a mean whose samples came in `valid` of the frames, from the variance of one
    /// sample at this frame rate.
    #[must_use]
    pub fn mean_variance(&self, sample_variance: f64, valid: u32) -> f64 {
        sample_variance / f64::from(valid.max(1))
    }

    /// Variances of the mean pose (x, y, yaw) when its noise is `scales` times the learned one.
    #[must_use]
    pub fn pose_variance(&self, model: &Model, scales: [f64; 3]) -> [f64; 3] {
        let noise = &model.noise;
        let learned = [noise.position_m, noise.position_m, noise.yaw_rad];
        std::array::from_fn(|i| {
            let sample = model.sample_variance(learned[i] * scales[i], self.frame_s);
            self.mean_variance(sample, self.pose_frames)
        })
    }

    /// Variances of one sample of each wheel's channel whose learned deviation is `sd`, when its
    /// noise is `scales` times that.
    #[must_use]
    pub(crate) fn sample_variances(
        &self,
        model: &Model,
        sd: f64,
        scales: [f64; WHEELS],
    ) -> [f64; WHEELS] {
        scales.map(|scale| model.sample_variance(sd * scale, self.frame_s))
    }

    /// Share of the time since the observation before that its frames cover: below 1 after a gap.
    #[must_use]
    pub fn covered(&self) -> f64 {
        let frames_s = self.t_ns.saturating_sub(self.t_first_ns) as f64 * 1e-9 + self.frame_s;
        match self.dt_s > frames_s {
            true => frames_s / self.dt_s,
            false => 1.0,
        }
    }

    /// How long the robot moved, s: time at rest is no evidence.
    #[must_use]
    pub const fn moved_s(&self) -> f64 {
        if self.moving { self.dt_s } else { 0.0 }
    }

    /// True where the body follows the command closely enough to tell noise from motion.
    #[must_use]
    pub fn is_steady(&self) -> bool {
        self.moving && (self.command[0] - self.curvature).abs() < STEADY_1_M && self.dt_s > 0.0
    }

    /// The displacement to this observation that a motion model expects.
    #[must_use]
    pub fn displacement(&self, model: &Model, motion: &MotionModel) -> Displacement {
        let limit = model.command.curvature_max_1_m;
        Displacement {
            per_metre: motion.per_metre(self.curvature, self.speed, limit),
            travel_m: self.travel_m,
            extra: match self.moving {
                true => self.lag_variance(),
                false => self.resting_variance(model),
            },
        }
    }

    /// Variance of the yaw, forward and lateral displacement beyond the motion model: how the body
    /// follows a changing command is known only roughly.
    #[must_use]
    pub const fn lag_variance(&self) -> [f64; 3] {
        [self.turn_variance, self.travel_variance, 0.0]
    }

    /// The same of a robot that creeps or rests, which slides on a slope.
    fn resting_variance(&self, model: &Model) -> [f64; 3] {
        let [yaw, forward, lateral] = self.lag_variance();
        let square = |sd: f64| RESTS * RESTS * sd * sd;
        let [turns, slides] = [model.noise.yaw_rad, model.noise.position_m].map(square);
        [yaw + turns, forward + slides, lateral + slides]
    }
}
