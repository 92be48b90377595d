#![doc = include_str!("../README.md")]

mod block_bytes;
mod cdr;
mod container;
mod definitions;
mod error;
mod live;
mod mend;
mod message_times;
mod messages;
mod pace;
mod part;
mod reader;
mod silence;
mod sink;
mod summary;
mod topics;
mod translation;
mod writer;

pub use block_bytes::{read_block, read_header};
pub use error::FlightError;
pub use live::{LiveMessages, MessageTaker, RosMessage};
pub use mend::{Mended, has_end, mend};
pub use part::{is_being_written, part_path};
pub use reader::{FlightReader, Recorded};
pub use summary::FlightSummary;
pub use topics::{RosTopic, Subject};
pub use writer::FlightWriter;
