#![doc = include_str!("../README.md")]

mod cdr;
mod container;
mod definitions;
mod error;
mod live;
mod message_times;
mod messages;
mod pace;
mod silence;
mod sink;
mod summary;
mod topics;
mod translation;
mod writer;

pub use error::FlightError;
pub use live::{LiveMessages, MessageTaker, RosMessage};
pub use summary::FlightSummary;
pub use topics::{RosTopic, Subject};
pub use writer::FlightWriter;
