//! Identifies the fault.
//!
//! [`Identifier`] is a pure function of journal entries; [`wiring`] connects it to its ports.

mod angles;
mod assemble;
mod blindfold;
mod check;
mod detection;
mod encoders;
mod engine;
mod fault_rates;
pub mod further;
mod further_likelihood;
mod further_stage;
mod further_state;
mod generic;
mod hypotheses;
mod identifier;
mod late;
mod modes;
mod multiple_hypothesis;
mod node_sizes;
mod posterior;
mod prepared;
mod rate_offsets;
mod reasons;
mod reported;
mod risk;
mod servo;
mod sets;
mod sizes;
mod state;
mod told_size;
mod trouble;
mod watcher;
pub mod wiring;

pub use assemble::{Models, assemble};
pub use identifier::{Identifier, Input};
pub use modes::{IdentifierError, Leaves};
pub use multiple_hypothesis::MultipleHypothesis;
pub use posterior::Posterior;
pub use risk::risks;
pub use watcher::{Diagnoser, Watcher};
pub use wiring::IdentifierStage;
