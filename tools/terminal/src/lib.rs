#![doc = include_str!("../README.md")]

mod command_tree;
mod ending;
pub mod output;
pub mod schema;

pub use command_tree::CommandTree;
pub use ending::{CommandError, Outcome, exit_code};
