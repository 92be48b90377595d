//! The detector as a stage of the graph.

mod assemble;
pub mod wiring;

pub use assemble::assemble;
pub use wiring::DetectorStage;
