//! The detector's belief: is something wrong?

use strum::{FromRepr, IntoStaticStr, VariantArray};
use vigil_checkpoint::CheckpointValue;

use crate::block::block;
use crate::header::{Cause, Header};
use crate::sensor::{CHANNELS, WHEELS};

/// Capacity of the evidence by channel: one place for each channel of a frame, in the same order,
/// and two for several channels at once ([`Evidence`]).
pub const EVIDENCE: usize = CHANNELS + 2;

/// Places in [`DetectionBelief::channel_log_odds`] and [`crate::FaultBelief::channel_evidence`]
/// after those of the channels.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Evidence;

impl Evidence {
    /// Motion: the pose's channels taken together.
    pub const POSE: usize = CHANNELS;
    /// Deviation of any kind: without a constant direction (the paper's constant likelihood), or
    /// in all channels at once.
    pub const ANY: usize = CHANNELS + 1;
}

block! {
    /// Written by the detector every cycle.
    pub struct DetectionBelief, size 880 {
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
        /// Estimated ratio of the noise of the pose (x, y, yaw) to the learned one (standard
        /// deviations).
        pub noise_scale: [f64; 3],
        /// The same for each wheel's rate.
        pub noise_scale_wheels: [f64; WHEELS],
        /// The same for each steering angle.
        pub noise_scale_steer: [f64; WHEELS],
        /// Estimated share of the samples of the pose (x, y, yaw) that are outliers.
        pub outlier_rate: [f64; 3],
        /// The same for each wheel's rate.
        pub outlier_rate_wheels: [f64; WHEELS],
        /// The same for each steering angle.
        pub outlier_rate_steer: [f64; WHEELS],
        /// Log-odds of a fault seen by each channel alone (see [`Evidence`]).
        pub channel_log_odds: [f64; EVIDENCE],
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
        /// Outcome of that action, as the frame says it: an [`crate::ActionOutcome`].
        pub action_outcome: u32,
        /// Why the detector sees nothing: a [`Blindness`]; 0 while it sees.
        pub blind: u32,
        /// Whether an alarm could rise now: a [`Readiness`].
        pub readiness: u32,
        /// When the last change came that is no fault, capture time, ns; 0 before the first one.
        pub context_t_capture_ns: u64,
        /// Such changes told so far.
        pub context_count: u32,
        /// Which of the description's contexts the last one was, from 0.
        pub context: u32,
    }
}

/// Why no valid frame has been seen for a second. A robot that stands by command is not blind.
#[derive(
    Debug, Clone, Copy, PartialEq, Eq, FromRepr, IntoStaticStr, VariantArray, CheckpointValue,
)]
#[strum(serialize_all = "kebab-case")]
#[repr(u32)]
pub enum Blindness {
    /// No frame comes.
    Silence = 1,
    /// Capture times do not advance like the graph's clock.
    Clock = 2,
    /// No channel that is watched is marked as valid.
    Validity = 3,
    /// Every frame begins a run of its own.
    Run = 4,
    /// Frames carry no valid command.
    Command = 5,
    /// Every frame comes from a writer of its own.
    Epoch = 6,
    /// Frames come, and the border refuses them all.
    Refused = 7,
    /// What is measured does not mean what the robot's description says: units, signs, axes. Until
    /// another publisher or a new run.
    Meaning = 8,
}

impl Blindness {
    /// All causes, in the order of their codes, which begin with 1.
    pub const ALL: &[Self] = Self::VARIANTS;

    /// Name, as in reports.
    #[must_use]
    pub fn name(self) -> &'static str {
        self.into()
    }

    /// In few words.
    #[must_use]
    pub const fn as_str(self) -> &'static str {
        match self {
            Self::Silence => "no frames",
            Self::Clock => "capture times do not follow the clock",
            Self::Validity => "no channel is marked as valid",
            Self::Run => "another run id in every frame",
            Self::Command => "no valid command",
            Self::Epoch => "another writer epoch in every frame",
            Self::Refused => "every frame is refused",
            Self::Meaning => "units, signs or axes are not the description's",
        }
    }
}

/// Whether an alarm could rise now.
#[derive(Debug, Clone, Copy, PartialEq, Eq, FromRepr)]
#[repr(u32)]
pub enum Readiness {
    /// Not yet: the track settles, and the noise becomes known.
    Arming = 1,
    /// Yes.
    Armed = 2,
    /// Armed, but the robot stands by command and shows nothing: the belief is held.
    NotExcited = 3,
}
