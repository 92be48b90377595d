#![doc = include_str!("../README.md")]

mod cdr;
mod container;
mod definitions;
mod error;
mod message_times;
mod messages;
mod pace;
mod summary;
mod translation;
mod writer;

pub use error::FlightError;
pub use summary::FlightSummary;
pub use writer::FlightWriter;
