//! Robots as models: description, kinematics, slip physics, faults, learned transitions.
//!
//! No I/O, no clock, no transport. A robot is described by a [`Description`] (from the
//! configuration); its behaviour is either simulated ([`slip`]) or learned: with its faults
//! ([`learned`]), or its nominal behaviour alone ([`nominal`]).

pub mod alarm;
mod body;
mod channel_odds;
pub mod chassis;
pub mod description;
pub mod disturbance;
pub mod disturbance_kind;
pub mod fault;
mod fault_prior;
pub mod frame_guard;
pub mod fused_alarm;
pub mod injection;
pub mod kinematics;
pub mod learned;
mod model_file;
pub mod nominal;
pub mod period;
pub mod publisher_check;
mod robot_model;
pub mod slip;
mod suspects;
pub mod tolerance;
pub mod tree;

pub use alarm::{Alarm, AlarmError};
pub use body::Body;
pub use description::{Description, MeasuredChannels};
pub use disturbance::Disturbance;
pub use disturbance_kind::DisturbanceKind;
pub use fault::{Fault, FaultKind};
pub use fault_prior::FaultPrior;
pub use frame_guard::FrameGuard;
pub use fused_alarm::FusedAlarm;
pub use injection::Injection;
pub use robot_model::RobotModel;
pub use suspects::Suspects;
pub use tolerance::Tolerance;
pub use tree::FaultTree;
