//! What the robot measured, independent of its kind.

use strum::FromRepr;

use crate::block::block;
use crate::header::Header;

/// Capacity of per-wheel arrays.
pub const WHEELS: usize = 8;
/// Capacity of the command vector.
pub const COMMANDS: usize = 4;

block! {
    /// One sensor frame. Written by sensor-sim or an external publisher, once per cycle.
    pub struct SensorFrame, size 408 {
        /// Common header; `t_schedule_ns` is when this cycle was due.
        pub header: Header,
        /// Identity of the run; a new value resets every filter.
        pub run_id: u64,
        /// Which fields hold a measurement: bits of [`Valid`].
        pub valid: u64,
        /// `decision_seq` of the last [`crate::Action`] that the robot obeyed; 0 for none.
        pub action_seq: u64,
        /// Outcome of that action: an [`ActionOutcome`].
        pub action_outcome: u32,
        /// Symptoms reported by monitors outside Vigil: bits of [`Symptoms`].
        pub symptoms: u32,
        /// Counts jumps of the pose's frame (relocalisation): a new value re-anchors the track.
        pub pose_reset_count: u32,
        /// 1 while the robot holds itself stopped because it has no valid action.
        pub safe_stop: u32,
        /// The command as executed; its meaning is given by the robot's description. Rover:
        /// signed curvature 1/m (left +), speed m/s.
        pub command: [f64; COMMANDS],
        /// Pose x m, y m, yaw rad (wrapped to ±π), in a continuous frame.
        pub pose: [f64; 3],
        /// Planned pose x m, y m, yaw rad, same frame as `pose`.
        pub planned_pose: [f64; 3],
        /// Yaw rate, rad/s.
        pub yaw_rate: f64,
        /// Wheel rates, rad/s, in the order of the robot's description.
        pub wheel_rate: [f64; WHEELS],
        /// Steering angles, rad, in the order of the robot's description (same index as wheel).
        pub steer: [f64; WHEELS],
        /// Motor currents, A, in the order of the robot's description.
        pub current: [f64; WHEELS],
        /// Reserved, zero.
        pub reserved: [f64; 5],
    }
}

/// Bits of [`SensorFrame::valid`].
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Valid;

impl Valid {
    /// `command[0]`; the others follow.
    pub const COMMAND: u64 = 1;
    /// x, y and yaw of `pose`.
    pub const POSE: u64 = 1 << 4;
    /// `planned_pose`.
    pub const PLANNED_POSE: u64 = 1 << 5;
    /// `yaw_rate`.
    pub const YAW_RATE: u64 = 1 << 6;

    /// `command[i]`.
    #[must_use]
    pub const fn command(i: usize) -> u64 {
        1 << i
    }
    /// `wheel_rate[i]`.
    #[must_use]
    pub const fn wheel_rate(i: usize) -> u64 {
        1 << (8 + i)
    }
    /// `steer[i]`.
    #[must_use]
    pub const fn steer(i: usize) -> u64 {
        1 << (16 + i)
    }
    /// `current[i]`.
    #[must_use]
    pub const fn current(i: usize) -> u64 {
        1 << (24 + i)
    }
}

/// Bits of the symptom sets in [`SensorFrame`], [`crate::DetectionBelief`] (paper, section 3).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Symptoms;

impl Symptoms {
    /// Error in position while stopped.
    pub const EPS: u32 = 1;
    /// Error in position while moving.
    pub const EPM: u32 = 2;
    /// Loop detected.
    pub const LD: u32 = 4;
    /// Spinning detected.
    pub const SD: u32 = 8;
    /// Blockage overtaken.
    pub const BO: u32 = 16;
    /// Alternative path found.
    pub const ALT: u32 = 32;
    /// Non-navigable alternative.
    pub const NNA: u32 = 64;
    /// All bits that have a meaning.
    pub const ALL: u32 = 127;
    /// Their names, in the order of the bits.
    pub const NAMED: [(&str, u32); 7] = [
        ("EPS", Self::EPS),
        ("EPM", Self::EPM),
        ("LD", Self::LD),
        ("SD", Self::SD),
        ("BO", Self::BO),
        ("ALT", Self::ALT),
        ("NNA", Self::NNA),
    ];
}

/// Outcome of the last action, as the robot reports it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, FromRepr)]
#[repr(u32)]
pub enum ActionOutcome {
    /// No action was taken.
    None = 0,
    /// In progress.
    Running = 1,
    /// Done as asked.
    Succeeded = 2,
    /// Could not be done.
    Failed = 3,
}

impl SensorFrame {
    /// True if every bit of `mask` is set in `valid`.
    #[must_use]
    pub const fn has(&self, mask: u64) -> bool {
        self.valid & mask == mask
    }
}
