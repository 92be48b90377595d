//! How a command ends, and the exit code of that.

use std::fmt;
use std::process::ExitCode;

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
}

impl fmt::Display for CommandError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.message)
    }
}

impl std::error::Error for CommandError {}

/// The exit code of a command: 0 done, 1 failed, 2 refused. What went wrong goes to standard error.
#[must_use]
pub fn exit_code(result: Result<Outcome, CommandError>) -> ExitCode {
    match result {
        Ok(Outcome::Done) => ExitCode::SUCCESS,
        Ok(Outcome::Failed) => ExitCode::from(1),
        Err(error) => {
            eprintln!("{error}");
            ExitCode::from(error.exit_code)
        }
    }
}
