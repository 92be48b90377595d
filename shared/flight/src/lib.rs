#![doc = include_str!("../README.md")]

mod block_bytes;
mod cdr;
mod container;
mod definitions;
mod error;
mod message_times;
mod messages;
mod pace;
mod reader;
mod summary;
mod translation;
mod writer;

pub use block_bytes::{read_block, read_header};
pub use error::FlightError;
pub use reader::{FlightReader, Recorded};
pub use summary::FlightSummary;
pub use writer::FlightWriter;
