//! What the robot measured, independent of its kind.

use strum::FromRepr;

use crate::block::block;
use crate::header::Header;

/// Capacity of per-wheel arrays of other blocks.
pub const WHEELS: usize = 8;
/// Capacity of the command vector.
pub const COMMANDS: usize = 8;
/// Capacity of measured channels.
pub const CHANNELS: usize = 48;

block! {
    /// One sensor frame. Written by sensor-sim or an external publisher, once per cycle.
    pub struct SensorFrame, size 576 {
        /// Common header; `t_schedule_ns` is when this cycle was due.
        pub header: Header,
        /// Identity of the run; a new value resets every filter.
        pub run_id: u64,
        /// Which command and channels the numbers mean: the hash of the robot's channel list. A
        /// frame with another one is refused.
        pub robot_hash: u64,
        /// Bit i: `channel[i]` holds a measurement.
        pub channel_valid: u64,
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
        /// Bit i: `command[i]` is known.
        pub command_valid: u32,
        /// 1 if `planned_pose` is known.
        pub planned_pose_valid: u32,
        /// The command as executed; the robot's description gives its axes and units. Rover: signed
        /// curvature 1/m (left +), speed m/s.
        pub command: [f64; COMMANDS],
        /// Measurements, in the order of the robot's channel list, in the units that it gives; 0
        /// where nothing was measured.
        pub channel: [f64; CHANNELS],
        /// Planned pose x m, y m, yaw rad, in the frame of the pose's channels.
        pub planned_pose: [f64; 3],
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
    /// The measurement of channel `i`; none if it is not marked as measured, or beyond capacity.
    #[must_use]
    pub const fn measured(&self, i: usize) -> Option<f64> {
        if i < CHANNELS && self.channel_valid >> i & 1 == 1 {
            Some(self.channel[i])
        } else {
            None
        }
    }

    /// Axis `i` of the command; none if it is not marked as known, or beyond capacity.
    #[must_use]
    pub const fn commanded(&self, i: usize) -> Option<f64> {
        if i < COMMANDS && self.command_valid >> i & 1 == 1 {
            Some(self.command[i])
        } else {
            None
        }
    }

    /// Writes channel `i` and marks it as measured; nothing happens beyond capacity.
    pub const fn set_channel(&mut self, i: usize, value: f64) {
        if i < CHANNELS {
            self.channel[i] = value;
            self.channel_valid |= 1 << i;
        }
    }

    /// Writes axis `i` of the command and marks it as known; nothing happens beyond capacity.
    pub const fn set_command(&mut self, i: usize, value: f64) {
        if i < COMMANDS {
            self.command[i] = value;
            self.command_valid |= 1 << i;
        }
    }

    /// The planned pose, if it is known.
    #[must_use]
    pub const fn planned(&self) -> Option<[f64; 3]> {
        if self.planned_pose_valid == 1 {
            Some(self.planned_pose)
        } else {
            None
        }
    }

    /// Writes the planned pose and marks it as known.
    pub const fn set_planned(&mut self, pose: [f64; 3]) {
        self.planned_pose = pose;
        self.planned_pose_valid = 1;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_what_is_marked_is_read_and_nothing_lies_beyond_capacity() {
        let mut frame = SensorFrame::default();
        frame.set_channel(47, 2.5);
        frame.set_command(7, -1.0);
        frame.set_channel(CHANNELS, 9.0);
        frame.set_command(COMMANDS, 9.0);
        assert_eq!(frame.channel_valid, 1 << 47);
        assert_eq!(frame.command_valid, 1 << 7);
        assert_eq!(frame.measured(47), Some(2.5));
        assert_eq!(frame.commanded(7), Some(-1.0));
        assert_eq!([frame.measured(0), frame.measured(CHANNELS)], [None; 2]);
        assert_eq!([frame.commanded(0), frame.commanded(COMMANDS)], [None; 2]);
        assert_eq!(frame.planned(), None);
        frame.set_planned([1.0, 2.0, 3.0]);
        assert_eq!(frame.planned(), Some([1.0, 2.0, 3.0]));
    }
}
