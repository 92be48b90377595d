//! `vigil events`: what has happened in a running graph.

use std::io;
use std::time::Duration;

use vigil_cycle::{Clock, Monotonic, has_hung_up, signal};
use vigil_setup::RunningArgs;
use vigil_terminal::{CommandError, Outcome, output};
use vigil_timeline::{EventReader, PendingMisses, TimelineEntry, told};

/// Between two looks while following.
const POLL: Duration = Duration::from_millis(50);

/// Prints what has happened in a running graph: the time of day, the seconds of the drive, who says
/// so, and what.
///
/// The launcher keeps the newest events, some hours of them.
#[derive(Debug, clap::Args)]
pub struct Args {
    #[command(flatten)]
    running: RunningArgs,
    /// Go on, and print each event as it comes, until Ctrl-C or the end of the graph.
    #[arg(long)]
    follow: bool,
    /// Print only the newest so many of those that are there.
    #[arg(long, value_name = "N")]
    last: Option<usize>,
    /// Print one JSON document a line for each event; also each step of the decision model.
    #[arg(long)]
    json: bool,
}

/// Prints the events.
///
/// # Errors
/// A graph that does not run; a file that cannot be read.
pub fn run(args: &Args) -> Result<Outcome, CommandError> {
    let running = args.running.find().map_err(CommandError::failure)?;
    let mut reader = EventReader::open(&running.domain.events_file());
    let past = new(&mut reader)?;
    let past = match args.json {
        true => past,
        false => told(&past),
    };
    let from = args.last.map_or(0, |last| past.len().saturating_sub(last));
    print(args, &past[from..]).map_err(CommandError::failure)?;
    let processes = running.processes();
    if processes.launcher.is_none() {
        let name = running.domain.graph();
        eprintln!(
            "the launcher of graph '{name}' is gone: nobody writes events; \
             `vigil run --adopt --graph {name}` goes on"
        );
    }
    if !args.follow {
        return Ok(Outcome::Done);
    }
    signal::install();
    let mut misses = PendingMisses::default();
    while !signal::stop_requested() {
        // Before the events: what is written until then belongs to it.
        let lives = running.lives();
        let new = new(&mut reader)?;
        let told = match args.json {
            true => new,
            false => {
                let told = new.iter().flat_map(|entry| misses.add(entry));
                let mut told: Vec<TimelineEntry> = told.collect();
                let now_ns = if lives { Monotonic.now_ns() } else { u64::MAX };
                told.extend(misses.due(now_ns));
                told
            }
        };
        print(args, &told).map_err(CommandError::failure)?;
        if !lives {
            eprintln!("the graph has ended");
        }
        if !lives || has_hung_up(&io::stdout()) {
            break;
        }
        std::thread::sleep(POLL);
    }
    Ok(Outcome::Done)
}

/// The events that have come since the last call.
fn new(reader: &mut EventReader) -> Result<Vec<TimelineEntry>, CommandError> {
    let next = || reader.next_entry().transpose();
    let entries: Result<_, io::Error> = std::iter::from_fn(next).collect();
    entries.map_err(CommandError::failure)
}

fn print(args: &Args, entries: &[TimelineEntry]) -> io::Result<()> {
    if args.json {
        return entries.iter().try_for_each(output::json_line);
    }
    let mut lines = entries.iter().map(TimelineEntry::line);
    lines.try_for_each(|line| output::line(&line))
}
