//! The identifier as a stage of the graph.

mod assemble;
mod told_size;
pub mod wiring;

pub use assemble::assemble;
pub use wiring::IdentifierStage;
