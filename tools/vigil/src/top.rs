//! `vigil top`: a running graph, live in the terminal.

mod belief;
mod chart;
mod events;
mod faults;
mod frame;
#[cfg(test)]
mod frame_tests;
mod head;
mod help;
mod line;
mod palette;
mod scene;
mod screen;
mod services;

use std::io::{self, IsTerminal, Write};

use vigil_cycle::topic::ServiceName;
use vigil_cycle::{placement, signal};
use vigil_setup::RunningArgs;
use vigil_terminal::{CommandError, Outcome, output};

use crate::faults::document::Now;
use crate::status::Document;
use crate::watch::{POLL, Watch};
use palette::Palette;
use scene::Scene;

/// Looks between two lines: one a second.
const LOOKS: u32 = 20;

/// Shows a running graph live: faults and why, beliefs, the decision, services, times, events.
///
/// It only looks. Keys: q ends it, ? explains, arrows scroll the events. Without a terminal it
/// prints a line a second. NO_COLOR is honoured.
#[derive(Debug, clap::Args)]
pub struct Args {
    #[command(flatten)]
    running: RunningArgs,
    /// Print one line a second, until Ctrl-C or the end of the graph.
    #[arg(long)]
    line: bool,
    /// Print one picture of 80 columns and 24 lines as text, and end.
    #[arg(long, conflicts_with = "line")]
    once: bool,
    /// With --once: print the JSON document of `vigil status` instead.
    #[arg(long, requires = "once")]
    json: bool,
}

/// Shows the graph.
///
/// # Errors
/// A graph that does not run; the transport's; a terminal that cannot be drawn to.
pub fn run(args: &Args) -> Result<Outcome, CommandError> {
    let mut watch = Watch::join(&args.running)?;
    let setup = watch.setup();
    placement::keep_off(&ServiceName::ALL.map(|name| setup.service(name).core));
    signal::install();
    watch.first_look();
    if args.once {
        return print_once(args, &watch);
    }
    let is_plain = std::env::var_os("TERM").is_some_and(|term| term == "dumb");
    match args.line || is_plain || !io::stdout().is_terminal() {
        true => print_lines(&mut watch),
        false => screen::run(
            &mut watch,
            Palette::new(std::env::var_os("NO_COLOR").as_deref()),
        ),
    }
    .map_err(CommandError::failure)?;
    Ok(Outcome::Done)
}

fn document(watch: &Watch) -> Document {
    Document::new(&watch.view, watch.setup(), Now::new())
}

fn print_once(args: &Args, watch: &Watch) -> Result<Outcome, CommandError> {
    let document = document(watch);
    let printed = match args.json {
        true => output::json(&document),
        false => output::line(&frame::text(&Scene::new(
            &document,
            &watch.view,
            Palette::PLAIN,
        ))),
    };
    printed.map_err(CommandError::failure)?;
    Ok(Outcome::Done)
}

fn print_lines(watch: &mut Watch) -> io::Result<()> {
    while !signal::stop_requested() {
        if !is_read(&line::text(&document(watch)))? {
            break;
        }
        if watch.view.has_ended {
            eprintln!("the graph has ended");
            break;
        }
        for _ in 0..LOOKS {
            if !signal::stop_requested() {
                std::thread::sleep(POLL);
                watch.look();
            }
        }
    }
    Ok(())
}

/// Prints a line; false once nobody reads it.
fn is_read(line: &str) -> io::Result<bool> {
    let mut out = io::stdout().lock();
    match writeln!(out, "{line}").and_then(|()| out.flush()) {
        Err(error) if error.kind() == io::ErrorKind::BrokenPipe => Ok(false),
        printed => printed.map(|()| true),
    }
}
