//! Identifies the fault.
//!
//! [`Identifier`] is a pure function of journal entries; [`wiring`] connects it to its ports.

mod assemble;
mod draw;
mod encoders;
mod exact;
mod identifier;
mod modes;
mod posterior;
mod reasons;
mod sets;
pub mod wiring;

pub use assemble::assemble;
pub use identifier::{Identifier, Input};
pub use modes::IdentifierError;
pub use wiring::IdentifierStage;
