#![doc = include_str!("../README.md")]

mod blocks;
mod checkpoints;
mod course;
mod difference;
mod error;
mod replay;
mod step;

pub use course::Tally;
pub use difference::Difference;
pub use error::ReplayError;
pub use replay::{Answer, Moment, Replay, What};
