//! The supervisor as a stage of the graph.

mod assemble;
mod wiring;

pub use assemble::{assemble, validity_ns};
pub use wiring::SupervisorStage;
