#![doc = include_str!("../README.md")]

mod counting;
pub mod exceptions;
pub mod learning;
mod model_text;
pub mod navigation;
mod parameter_number;
pub mod recovery;
pub mod simulation;

pub use counting::{Fit, FittedChance};
