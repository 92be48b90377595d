#![doc = include_str!("../README.md")]

mod action;
mod answered_wheels;
mod block;
mod checkpoint;
mod control;
pub mod datagram;
mod detection;
mod diagnosis;
mod faults;
mod header;
mod health;
mod journal;
pub mod layout;
mod particles;
mod rejection;
mod sensor;
mod size_kind;
mod truth;
mod verdict;
mod weighing;

pub use action::{
    Action, ActionRejection, ControlMode, DECISION_ACTIONS, DECISION_STATES, RecoveryKind,
    ValueKind,
};
pub use answered_wheels::AnsweredWheels;
pub use block::{Block, fnv1a};
#[doc(hidden)]
pub use block::{ascii, name_with_hash};
pub use control::{Control, ControlCommand};
pub use detection::{Blindness, DetectionBelief, EVIDENCE, Evidence, Readiness};
pub use diagnosis::{
    CATCHING_UP, FAULT_NODES, FAULT_SETS, FaultBelief, FaultSet, MODE_BLIND, MODE_MULTIPLE,
    MODE_UNKNOWN, mode_word,
};
pub use faults::{
    Carryover, FAULTS, FaultRecord, FaultSource, FaultState, Faults, OverallState, Severity,
};
pub use header::{BlockId, Cause, CauseKind, Header};
pub use health::{Degraded, EVENTS, Event, EventKind, Health, ServiceState};
pub use journal::{
    CHECKPOINT_BYTES, CheckpointPart, Entry, JOURNAL_ENTRIES, Journal, JournalEntry, JournalKind,
    STATE_BYTES_MAX,
};
pub use particles::{HealthyBelief, PARTICLE_CAPACITY, ParticleBlock, WeightedHypothesis};
pub use rejection::{REJECTIONS, Rejection};
pub use sensor::{ActionOutcome, CHANNELS, COMMANDS, SensorFrame, Symptoms, WHEELS};
pub use size_kind::SizeKind;
pub use truth::Truth;
pub use verdict::{NAME_SIZE, Verdict, fixed_name};
pub use weighing::Weighing;
