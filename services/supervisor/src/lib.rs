#![doc = include_str!("../README.md")]

mod assemble;
mod wiring;

pub use assemble::{assemble, validity_ns};
pub use wiring::SupervisorStage;
