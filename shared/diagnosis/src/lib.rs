//! The diagnosis as pure functions of journal entries: [`detect`] finds any deviation from nominal
//! behaviour, [`identify`] names the fault. No transport, no clock, no files.

pub mod detect;
pub mod identify;
mod sensors;

pub use sensors::Sensors;
