//! `vigil faults`, `ack` and `clear`: the life of the faults of a running graph.

pub mod document;
mod order;
pub mod table;
mod view;

use std::time::{Duration, Instant};

use vigil_setup::RunningArgs;
use vigil_terminal::{CommandError, Outcome, output};

pub use document::Document;
pub use order::{AckArgs, ClearArgs, acknowledge, clear};
use view::View;

/// Between two looks while following.
const POLL: Duration = Duration::from_millis(50);

/// Lists the faults of a running graph: what failed, since when, and whether somebody knows.
///
/// Exit codes: 0 nothing is left to acknowledge, 1 a fault is active or latched, or nothing is
/// known. `vigil status` says by its own whether all is well.
#[derive(Debug, clap::Args)]
pub struct Args {
    #[command(flatten)]
    running: RunningArgs,
    /// Print one JSON document; with --follow one a line, whenever something changes.
    #[arg(long)]
    json: bool,
    /// Go on, and print the list anew whenever something changes, until Ctrl-C.
    #[arg(long)]
    follow: bool,
}

/// Prints the faults.
///
/// # Errors
/// A configuration that is refused; a graph that does not run, or says nothing.
pub fn run(args: &Args) -> Result<Outcome, CommandError> {
    let mut view = View::join(&args.running)?;
    let mut document = view.first()?;
    print(args, &document).map_err(CommandError::failure)?;
    if !args.follow {
        return Ok(match document.needs_attention() {
            true => Outcome::Failed,
            false => Outcome::Done,
        });
    }
    vigil_cycle::signal::install();
    let mut heard = Instant::now();
    while !vigil_cycle::signal::stop_requested() {
        std::thread::sleep(POLL);
        let newest = view.newest()?;
        if newest.is_some() {
            heard = Instant::now();
        }
        let newest = match newest {
            None if heard.elapsed() > view::STALE => Some(document.gone_stale()),
            newest => newest,
        };
        let changed = newest.filter(|newest| newest.differs_from(&document));
        if let Some(newest) = changed {
            print(args, &newest).map_err(CommandError::failure)?;
            document = newest;
        }
        if vigil_cycle::has_hung_up(&std::io::stdout()) {
            break;
        }
        if !view.is_running() {
            eprintln!("the graph has ended");
            break;
        }
    }
    Ok(Outcome::Done)
}

fn print(args: &Args, document: &Document) -> std::io::Result<()> {
    match (args.json, args.follow) {
        (true, true) => output::json_line(document),
        (true, false) => output::json(document),
        (false, _) => output::line(&table::text(document)),
    }
}
