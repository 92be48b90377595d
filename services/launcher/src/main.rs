//! `vigil-launcher`: what `vigil run` becomes.

use std::process::ExitCode;

use clap::Parser;
use vigil_launcher::{LauncherArgs, launch};

fn main() -> ExitCode {
    launch(&LauncherArgs::parse())
}
