//! What the commands share: output, progress, how they end.

mod ending;
pub mod output;

pub use ending::{CommandError, Outcome, exit_code};
