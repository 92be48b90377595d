#![doc = include_str!("../README.md")]

pub mod frames;
pub mod labels;
mod run_writer;
pub mod table;
mod writer;

pub use run_writer::{FrameCounts, RunWriter};
pub use writer::FrameWriter;
