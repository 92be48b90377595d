//! `vigil ros2`: another program, `vigil-ros2`, with a build of its own beside the project's.

use std::ffi::OsString;

use vigil_terminal::{CommandError, Outcome};

use crate::beside;

/// The program.
pub const PROGRAM: beside::Program = beside::Program {
    name: "vigil-ros2",
    build: "--manifest-path tools/ros2/Cargo.toml --target-dir target",
};

/// Publishes what a running graph says as topics of ROS 2: faults, beliefs, decisions, services.
///
/// It becomes `vigil-ros2`, which has a build of its own: `cargo build --release --manifest-path
/// tools/ros2/Cargo.toml --target-dir target`. Options, as `vigil-ros2 --help` explains them:
/// `--graph NAME`, `--domain N`, `--all`, `--rate HZ`, `--address IP`, `--humble`, `--once`.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Options of `vigil-ros2`.
    #[arg(
        trailing_var_arg = true,
        allow_hyphen_values = true,
        value_name = "OPTIONS"
    )]
    words: Vec<OsString>,
}

/// Becomes `vigil-ros2` with these words.
///
/// # Errors
/// A program that is not built.
pub fn run(args: &Args) -> Result<Outcome, CommandError> {
    match beside::become_program(PROGRAM, args.words.iter().cloned())? {}
}
