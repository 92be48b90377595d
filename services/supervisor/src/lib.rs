#![doc = include_str!("../README.md")]

mod assemble;
mod fault_board;
mod steps;
mod wiring;

pub use assemble::{assemble, fault_life, fault_step, validity_ns};
pub use fault_board::FaultBoard;
pub use steps::{FaultStep, Steps};
pub use wiring::SupervisorStage;
