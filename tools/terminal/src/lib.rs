#![doc = include_str!("../README.md")]

mod ending;
pub mod output;
pub mod schema;

pub use ending::{CommandError, Outcome, exit_code};
