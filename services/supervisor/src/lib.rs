//! The supervisor: tracks the belief of a recovery POMDP and decides what to do.
//!
//! [`Supervisor::step`] is a pure function of state and journal entry; [`SupervisorStage`] puts it
//! at its ports.

mod assemble;
mod epoch;
mod evidence;
mod exceptions;
mod fused;
mod hardware;
mod leaves;
mod mapping;
mod observations;
mod policy;
mod restraint;
mod silence;
mod supervisor;
mod told;
mod watch;
mod wiring;

pub use assemble::{assemble, validity_ns};
pub use fused::fused_alarm;
pub use mapping::{Compensation, SupervisorError};
pub use supervisor::{Inputs, Supervisor};
pub use wiring::SupervisorStage;
