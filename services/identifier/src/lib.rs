#![doc = include_str!("../README.md")]

mod assemble;
mod size_report;
pub mod wiring;

pub use assemble::assemble;
pub use wiring::IdentifierStage;
