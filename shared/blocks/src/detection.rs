//! The detector's belief: is something wrong?

use crate::block::block;
use crate::{Cause, Header};

/// Capacity of the per-channel evidence.
pub const CHANNELS: usize = 32;

/// Index into [`DetectionBelief::channel_log_odds`].
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Channel;

impl Channel {
    /// Motion: the pose track.
    pub const POSE: usize = 0;
    /// Yaw rate.
    pub const YAW_RATE: usize = 1;
    /// Deviation of any kind, without a constant direction (the paper's constant likelihood).
    pub const ANY: usize = 2;

    /// Wheel rate of wheel `i`.
    #[must_use]
    pub const fn wheel_rate(i: usize) -> usize {
        8 + i
    }
    /// Steering angle of wheel `i`.
    #[must_use]
    pub const fn steer(i: usize) -> usize {
        16 + i
    }
    /// Motor current of wheel `i`.
    #[must_use]
    pub const fn current(i: usize) -> usize {
        24 + i
    }
}

block! {
    /// Written by the detector every cycle.
    pub struct DetectionBelief, size 448 {
        /// Common header.
        pub header: Header,
        /// The journal entry behind this belief.
        pub cause: Cause,
        /// Run of the frame.
        pub run_id: u64,
        /// Probability that the robot is not in its nominal mode.
        pub p_fault: f64,
        /// Its log-odds, natural logarithm.
        pub log_odds: f64,
        /// Log-odds at which the alarm rises (calibrated; natural logarithm).
        pub alarm_log_odds: f64,
        /// Log-likelihood of this frame under the nominal mode, natural logarithm.
        pub evidence: f64,
        /// Effective sample size of the particles, before resampling.
        pub effective_sample_size: f64,
        /// Estimated ratio of the pose's noise to the learned one (standard deviations).
        pub noise_scale: f64,
        /// The same for the wheel rates.
        pub noise_scale_wheels: f64,
        /// The same for the steering angles.
        pub noise_scale_steer: f64,
        /// Log-odds of a fault seen by each channel alone (see [`Channel`]).
        pub channel_log_odds: [f64; CHANNELS],
        /// `decision_seq` of the last action that the robot obeyed, as the frame says it.
        pub action_seq: u64,
        /// Capture time of the frame that raised the present alarm, ns; 0 without alarm.
        pub alarm_t_capture_ns: u64,
        /// 1 while the alarm stands.
        pub alarm: u32,
        /// Alarms raised so far.
        pub alarm_count: u32,
        /// Symptoms: the detector's own or-ed with external ones (see [`crate::Symptoms`]).
        pub symptoms: u32,
        /// Frames refused by the filter because a channel was not finite or out of range.
        pub invalid_count: u32,
        /// Steps whose weights degenerated (coasted, or re-initialised).
        pub degenerate_count: u32,
        /// Particles in use.
        pub particle_count: u32,
        /// Outcome of that action, as the frame says it: an [`crate::ActionOutcome`].
        pub action_outcome: u32,
        /// Reserved, zero.
        pub reserved: u32,
    }
}
