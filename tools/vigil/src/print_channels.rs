//! `vigil channels`: which place of a frame's command and channels means what.

use std::path::PathBuf;

use vigil_robot::channel::channel_list_text;
use vigil_setup::load_robot;
use vigil_terminal::output;
use vigil_terminal::{CommandError, Outcome};

/// Prints a robot's channel list, for publishers on another machine.
///
/// A running graph has the same text in the file `channels` of its runtime folder.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// The robot's description.
    #[arg(long, value_name = "FILE")]
    robot: PathBuf,
}

/// Prints it.
///
/// # Errors
/// What is wrong with the description; standard output's.
pub fn run(args: &Args) -> Result<Outcome, CommandError> {
    let robot = load_robot(&args.robot).map_err(CommandError::usage)?;
    output::line(channel_list_text(&robot).trim_end()).map_err(CommandError::failure)?;
    Ok(Outcome::Done)
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;

    #[test]
    fn the_examples_list_is_that_of_the_rovers_description() {
        let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
        let robot = load_robot(&root.join("config/robots/rover.toml")).unwrap();
        let shipped = std::fs::read_to_string(root.join("examples/rover.channels")).unwrap();
        assert_eq!(shipped, channel_list_text(&robot));
        // The order that the module `vigil_robot::channel` promises.
        for line in [
            "command 0 cmd_curv 1/m",
            "command 1 cmd_speed m/s",
            "channel 0 x m",
            "channel 3 enc_LF rad/s",
            "channel 12 steer_RR rad",
            "channel 13 yaw_rate rad/s",
            "channel 19 current_RR A",
        ] {
            assert!(shipped.lines().any(|other| other == line), "{line}");
        }
        assert_eq!(shipped.lines().count(), 1 + 2 + 20);
    }
}
