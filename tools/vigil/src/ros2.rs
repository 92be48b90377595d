//! `vigil ros2`: another program, `vigil-ros2`, with a build of its own beside the project's.

use std::ffi::OsString;

use vigil_terminal::{CommandError, Outcome};

use crate::beside;

/// What builds it.
const BUILD: &str = "--manifest-path tools/ros2/Cargo.toml --target-dir target";

/// Publishes what a running graph says as topics of ROS 2: faults, beliefs, decisions, services.
///
/// It becomes `vigil-ros2`, which has a build of its own: `cargo build --release --manifest-path
/// tools/ros2/Cargo.toml --target-dir target`. `vigil ros2 --help` lists its options once it is
/// built.
#[derive(Debug, clap::Args)]
#[command(disable_help_flag = true)]
pub struct Args {
    /// Options of `vigil-ros2`, such as `--graph NAME`, `--domain N`, `--all`.
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
    let program = beside::Program {
        name: "vigil-ros2",
        build: BUILD,
    };
    match beside::become_program(program, args.words.iter().cloned())? {}
}
