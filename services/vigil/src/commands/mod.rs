//! The commands, one a module: each has its `Args` and a `run`.

use std::fmt;

pub mod check;
pub mod check_publisher;
pub mod diagnose;
pub mod evaluate;
pub mod import;
pub mod inject;
pub mod learn;
mod learn_nominal;
mod offline;
pub mod pomdp;
pub mod print_types;

/// How a command ended that could do its work.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Outcome {
    /// Done.
    Done,
    /// Done, and what it found is a failure.
    Failed,
}

/// Why a command could not do its work.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct CommandError {
    message: String,
    exit_code: u8,
}

impl CommandError {
    /// What the user gave is refused: options, configuration, files. Exit code 2.
    pub fn usage(message: impl ToString) -> Self {
        Self {
            message: message.to_string(),
            exit_code: 2,
        }
    }

    /// Something failed on the way. Exit code 1.
    pub fn failure(message: impl ToString) -> Self {
        Self {
            message: message.to_string(),
            exit_code: 1,
        }
    }

    /// The process's exit code.
    pub const fn exit_code(&self) -> u8 {
        self.exit_code
    }
}

impl fmt::Display for CommandError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.message)
    }
}
