#![doc = include_str!("../README.md")]

mod assemble;
mod fault_board;
mod wiring;

pub use assemble::{assemble, fault_life, validity_ns};
pub use fault_board::FaultBoard;
pub use wiring::SupervisorStage;
