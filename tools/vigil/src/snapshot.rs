//! `vigil snapshot`: asks the black box of a running graph for a recording.

use std::fs;
use std::time::{Duration, Instant};

use vigil_setup::RunningArgs;
use vigil_terminal::{CommandError, Outcome, output};

/// Time in which the black box hears a request.
const LIMIT: Duration = Duration::from_secs(2);
/// Between two looks.
const POLL: Duration = Duration::from_millis(10);

/// Asks the black box for a recording of the last minute and of what follows.
///
/// It prints the folder in which the recording will lie. `vigil recordings` lists it, and whether
/// it is still being written. While an alarm is being recorded, the request is noted in that
/// recording.
#[derive(Debug, clap::Args)]
pub struct Args {
    #[command(flatten)]
    running: RunningArgs,
    /// Why, in words; they stand in the recording.
    #[arg(value_name = "TEXT", default_value = "somebody asked for it")]
    text: String,
}

/// Asks, and waits until the black box has heard it.
///
/// # Errors
/// A graph that does not run, or has no black box.
pub fn run(args: &Args) -> Result<Outcome, CommandError> {
    let running = args.running.find().map_err(CommandError::failure)?;
    let domain = &running.domain;
    let name = domain.graph();
    let lives = |pid| domain.find_process(pid).is_some();
    if !running.processes().blackbox.is_some_and(lives) {
        let message = format!("graph '{name}' has no black box");
        return Err(CommandError::failure(message));
    }
    let request = domain.request_file();
    let begun = request.with_extension(std::process::id().to_string());
    // The box meets all of it, or nothing.
    fs::write(&begun, &args.text)
        .and_then(|()| fs::rename(&begun, &request))
        .map_err(|error| CommandError::failure(format!("{}: {error}", request.display())))?;
    let began = Instant::now();
    while request.exists() {
        if began.elapsed() > LIMIT {
            let _ = fs::remove_file(&request);
            let message = format!("the black box of graph '{name}' does not answer");
            return Err(CommandError::failure(message));
        }
        std::thread::sleep(POLL);
    }
    let folder = fs::read_to_string(domain.recordings_file());
    let folder = folder.map_err(CommandError::failure)?;
    output::line(&folder).map_err(CommandError::failure)?;
    Ok(Outcome::Done)
}
