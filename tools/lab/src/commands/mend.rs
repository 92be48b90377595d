//! `vigil mend`: a recording that was cut short, made whole.

use std::path::PathBuf;

use vigil_terminal::{CommandError, Outcome};

/// Makes a recording whole that was cut short, so that every program can open it.
///
/// The black box does so at its start with what a loss of power has left. This command does it for
/// a file of `vigil record` that was killed, FILE.mcap.part, and for one that is damaged: what
/// comes before the damage is kept. Exit codes: 0 done, 1 done up to a damage, or nothing to mend.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// The recording that was cut short.
    #[arg(value_name = "RECORDING")]
    recording: PathBuf,
    /// Where to write; a file that is there is not replaced.
    #[arg(short, long, value_name = "FILE")]
    out: PathBuf,
}

/// Mends.
///
/// # Errors
/// A file that is whole, of which nothing can be read, or that cannot be written.
pub fn run(args: &Args) -> Result<Outcome, CommandError> {
    if args.out.exists() {
        let message = format!("{} exists", args.out.display());
        return Err(CommandError::usage(message));
    }
    let mended = vigil_flight::mend(&args.recording, &args.out).map_err(CommandError::failure)?;
    eprintln!("wrote {}: {} messages", args.out.display(), mended.messages);
    Ok(match mended.damage {
        None => Outcome::Done,
        Some(damage) => {
            eprintln!("what follows is lost: {damage}");
            Outcome::Failed
        }
    })
}
