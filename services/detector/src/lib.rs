#![doc = include_str!("../README.md")]

mod assemble;
pub mod wiring;

pub use assemble::assemble;
pub use wiring::DetectorStage;
