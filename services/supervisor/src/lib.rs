#![doc = include_str!("../README.md")]

mod assemble;
mod fault_board;
mod steps;
mod wiring;

pub use assemble::{StepsError, assemble, fault_life, steps, validity_ns};
pub use steps::{FaultStep, Steps};
pub use wiring::SupervisorStage;
