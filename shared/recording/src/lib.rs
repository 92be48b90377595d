#![doc = include_str!("../README.md")]

pub mod frames;
pub mod labels;
pub mod table;
mod writer;

pub use writer::FrameWriter;
