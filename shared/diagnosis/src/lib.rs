#![doc = include_str!("../README.md")]

pub mod detect;
pub mod identify;
mod invariants;
mod sensors;

pub use sensors::Sensors;
