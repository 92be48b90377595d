#![doc = include_str!("../README.md")]

mod blocks;
mod checkpoints;
mod difference;
mod error;
mod replay;
mod service_replay;
mod step;

pub use difference::Difference;
pub use error::ReplayError;
pub use replay::{Answer, Moment, Replay, What};
pub use service_replay::Tally;
