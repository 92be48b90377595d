#![doc = include_str!("../README.md")]

pub mod detect;
pub mod identify;
mod invariants;
#[cfg(test)]
mod rover;
mod sensors;

pub use sensors::Sensors;
