//! Wire blocks of the Vigil graph.
//!
//! Every block is a fixed-size `#[repr(C)]` struct of plain integers and floats, natural alignment
//! (at most 8 bytes), no padding: it is written in place in shared memory and read in place by
//! any process, in Rust, C or Python. Nothing here has behaviour beyond reading a field.
//!
//! Units are SI, angles radians, times `CLOCK_MONOTONIC` nanoseconds; frames follow REP-103 and
//! REP-105 (x forward, y left, yaw counter-clockwise; poses in a continuous frame such as `odom`).
//!
//! | block | written by | says |
//! |---|---|---|
//! | [`SensorFrame`] | sensor-sim or an external publisher | what the robot measured and did |
//! | [`DetectionBelief`] | detector | is something wrong? |
//! | [`ParticleBlock`] | detector, identifier | the filter's hypotheses, or its particles |
//! | [`FaultBelief`] | identifier | what is wrong? |
//! | [`Action`] | supervisor | what to do about it |
//! | [`Health`] | each service | cycle, deadline and input accounting, recent events |
//! | [`Control`] | operator's tool | inject, clear, reset |

mod action;
mod block;
mod control;
pub mod datagram;
mod detection;
mod diagnosis;
mod header;
mod health;
mod journal;
pub mod layout;
mod particles;
mod rejection;
mod sensor;
mod size_kind;

pub use action::{
    Action, ActionRejection, ControlMode, DECISION_ACTIONS, DECISION_STATES, RecoveryKind,
    ValueKind,
};
pub use block::{Block, fnv1a};
#[doc(hidden)]
pub use block::{ascii, name_with_hash};
pub use control::{Control, ControlCommand};
pub use detection::{Blindness, CHANNELS, Channel, DetectionBelief, Readiness};
pub use diagnosis::{
    FAULT_NODES, FAULT_SETS, FaultBelief, FaultSet, MODE_BLIND, MODE_MULTIPLE, MODE_UNKNOWN,
};
pub use header::{BlockId, Cause, CauseKind, Header};
pub use health::{Degraded, EVENTS, Event, EventKind, Health, ServiceState};
pub use journal::Entry;
pub use particles::{HealthyBelief, PARTICLE_CAPACITY, ParticleBlock, WeightedHypothesis};
pub use rejection::{REJECTIONS, Rejection};
pub use sensor::{ActionOutcome, COMMANDS, SensorFrame, Symptoms, Valid, WHEELS};
pub use size_kind::SizeKind;
