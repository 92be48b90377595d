//! The life of faults: what failed, since when, and whether somebody knows.

use strum::{FromRepr, IntoStaticStr};
use vigil_checkpoint::CheckpointValue;

use crate::block::block;
use crate::header::Header;
use crate::layout::part;
use crate::sensor::{CHANNELS, COMMANDS};

/// Capacity of faults that are kept; the oldest cleared one gives way to a new one.
pub const FAULTS: usize = 16;

part! {
/// A fault with its history. Times are instants of `CLOCK_MONOTONIC` at which the supervisor knew,
/// but for the freeze frame's.
#[derive(CheckpointValue)]
pub struct FaultRecord, size 576 {
    /// Counts the graph's faults, from 1; 0: this place is free.
    pub number: u64,
    /// When it was present first, ns.
    pub first_ns: u64,
    /// When it was present last, ns.
    pub last_ns: u64,
    /// When its state changed last, ns.
    pub changed_ns: u64,
    /// Probability when it was present last.
    pub p: f64,
    /// Expected size then, in the unit of `size_kind`; 0 without one.
    pub size: f64,
    /// Its standard deviation.
    pub size_sd: f64,
    /// Evidence of `evidence_channel` then, nat.
    pub evidence: f64,
    /// Freeze frame: capture time of the frame nearest to the onset of the most probable fault, ns;
    /// 0 without one.
    pub frame_t_capture_ns: u64,
    /// See [`crate::SensorFrame::channel_valid`], of the freeze frame.
    pub channel_valid: u64,
    /// Its channels.
    pub channel: [f64; CHANNELS],
    /// Its command.
    pub command: [f64; COMMANDS],
    /// Where it lies: a [`FaultSource`].
    pub source: u32,
    /// Of the robot: a node of the fault tree or [`crate::MODE_UNKNOWN`]. Of an input: a
    /// [`crate::Blindness`]. Of a service: its index in the order of the data.
    pub what: u32,
    /// A [`FaultState`].
    pub state: u32,
    /// A [`Severity`].
    pub severity: u32,
    /// How often it became active.
    pub count: u32,
    /// A [`crate::SizeKind`].
    pub size_kind: u32,
    /// The channel that spoke most for it; see [`crate::Evidence`].
    pub evidence_channel: u32,
    /// The next best explanation: a mode, as in [`crate::FaultBelief::runner_up`].
    pub runner_up: u32,
    /// What was done about it last: an action of the decision model.
    pub action: u32,
    /// See [`crate::SensorFrame::command_valid`], of the freeze frame.
    pub command_valid: u32,
    /// 1 if it stays until somebody acknowledges it.
    pub latches: u32,
    /// Reserved, zero.
    pub reserved: u32,
}
}

part! {
/// What a supervisor leaves to one that replaces it in the same run.
#[derive(CheckpointValue)]
pub struct Carryover, size 48 {
    /// The run.
    pub run_id: u64,
    /// Capture time of the frame that raised the detector's alarm, ns; 0 while none stands.
    pub detected_t_capture_ns: u64,
    /// The detector's probability of a fault.
    pub p_fault: f64,
    /// See [`crate::Action::alarm_t_capture_ns`].
    pub alarm_t_capture_ns: u64,
    /// Hash of the decision model.
    pub model_hash: u64,
    /// See [`crate::Action::alarm_count`].
    pub alarm_count: u32,
    /// 1 + the action of the decision model that stands until a new run, whatever is believed; 0
    /// without one.
    pub latched: u32,
}
}

block! {
    /// Written by the supervisor whenever something changes, and ten times a second.
    pub struct Faults, size 9344 {
        /// Common header.
        pub header: Header,
        /// Hash of the fault tree that gives the nodes their names.
        pub tree_hash: u64,
        /// Rises with each change of a fault or of the overall state.
        pub revision: u64,
        /// Faults so far, kept or not.
        pub fault_count: u64,
        /// What is present and has no place.
        pub dropped_count: u32,
        /// The overall state: an [`OverallState`].
        pub overall: u32,
        /// What the next supervisor goes on from.
        pub carryover: Carryover,
        /// The faults, in no order.
        pub records: [FaultRecord; FAULTS],
    }
}

impl Carryover {
    /// The action that stands.
    #[must_use]
    pub const fn latched(&self) -> Option<usize> {
        match self.latched.checked_sub(1) {
            Some(action) => Some(action as usize),
            None => None,
        }
    }

    /// True if it says another thing than `other`. How probable a fault is wanders: only a
    /// difference of 0.05 is one.
    #[must_use]
    pub fn differs_from(&self, other: &Self) -> bool {
        let of = |it: &Self| Self {
            p_fault: 0.0,
            ..*it
        };
        of(self) != of(other) || (self.p_fault - other.p_fault).abs() > 0.05
    }
}

impl Faults {
    /// The faults that are kept.
    pub fn kept(&self) -> impl Iterator<Item = &FaultRecord> {
        self.records.iter().filter(|record| record.number != 0)
    }
}

impl FaultRecord {
    /// The state, if this version knows it.
    #[must_use]
    pub const fn state(&self) -> Option<FaultState> {
        FaultState::from_repr(self.state)
    }
}

/// The state of a fault in its life.
#[derive(Debug, Clone, Copy, PartialEq, Eq, FromRepr, IntoStaticStr)]
#[strum(serialize_all = "kebab-case")]
#[repr(u32)]
pub enum FaultState {
    /// Present, but not yet for long enough to be told.
    Pending = 1,
    /// Present.
    Active = 2,
    /// Present, and somebody knows.
    Acknowledged = 3,
    /// Present no longer, but nobody has acknowledged it.
    Latched = 4,
    /// Over: kept as history.
    Cleared = 5,
}

/// Where a fault lies.
#[derive(Debug, Clone, Copy, PartialEq, Eq, FromRepr, IntoStaticStr)]
#[strum(serialize_all = "kebab-case")]
#[repr(u32)]
pub enum FaultSource {
    /// In the robot.
    Robot = 1,
    /// In what the graph is sent.
    Input = 2,
    /// In a service of the graph.
    Service = 3,
}

/// How grave a fault is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, FromRepr, IntoStaticStr)]
#[strum(serialize_all = "kebab-case")]
#[repr(u32)]
pub enum Severity {
    /// The robot does its work with less reserve.
    Warning = 1,
    /// The robot cannot be trusted to do its work.
    Fault = 2,
}

/// How robot and graph are, in one word.
#[derive(Debug, Clone, Copy, PartialEq, Eq, FromRepr, IntoStaticStr, CheckpointValue)]
#[strum(serialize_all = "kebab-case")]
#[repr(u32)]
pub enum OverallState {
    /// Nothing is wrong.
    Ok = 1,
    /// Warnings at most.
    Degraded = 2,
    /// A fault is present, or was and nobody has acknowledged it.
    Fault = 3,
    /// A fault is present, and the robot is told to stand.
    SafeStop = 4,
    /// Nothing is seen: how the robot is, is not known.
    Stale = 5,
}

macro_rules! named {
    ($($kind:ty),+) => { $(
        impl $kind {
            /// Name, as in reports.
            #[must_use]
            pub fn name(self) -> &'static str {
                self.into()
            }
        }
    )+ };
}
named!(FaultState, FaultSource, Severity, OverallState);
