//! The decision as a pure function of state and journal entry: evidence becomes a belief of a
//! recovery POMDP, the belief an action. No transport, no clock, no files.

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
mod settings;
mod silence;
mod supervisor;
mod told;
mod watch;

pub use fused::fused_alarm;
pub use mapping::{Compensation, SupervisorError};
pub use settings::{Evidence, Gate, Recovery, RecoveryAction, Settings};
pub use supervisor::{Inputs, Supervisor};
