//! `vigil status`: one look at a running graph.

mod belief;
mod decision;
mod document;
mod input;
mod service;
mod state;
mod text;

use vigil_setup::RunningArgs;
use vigil_terminal::{CommandError, Outcome, output};

use crate::faults::document::Now;
use crate::watch::Watch;

pub use belief::{Diagnosis, NamedNode};
pub use decision::Decision;
pub use document::Document;
pub use service::Service;
pub use state::GraphState;
pub use text::percent_text;

/// Shows the state of a running graph once: faults, beliefs, the decision, services, times.
///
/// A reason is the channel that speaks most for a fault, by so many nat: 2.3 nat is a factor of 10
/// in likelihood. The runner-up is what would explain the data next best.
///
/// The decision names the wheels that it is about. compensate: drive on, and steer against a stuck
/// wheel. ignore_encoder: drive on without that encoder. limp_home: both, for several faults;
/// `LF_ENC` is the wheel LF, whose encoder is not trusted. What an action is worth is the reward
/// that the decision model expects from now on, in its own unit; after it stands what the next best
/// is worth less.
///
/// Exit codes: 0 nothing is wrong and a launcher supervises the graph, else 1.
#[derive(Debug, clap::Args)]
pub struct Args {
    #[command(flatten)]
    running: RunningArgs,
    /// Print one JSON document.
    #[arg(long)]
    json: bool,
}

/// Prints the status.
///
/// # Errors
/// A graph that does not run; the transport's.
pub fn run(args: &Args) -> Result<Outcome, CommandError> {
    let mut watch = Watch::join(&args.running)?;
    watch.first_look();
    let document = Document::new(&watch.view, watch.setup(), Now::new());
    let printed = match args.json {
        true => output::json(&document),
        false => output::line(&text::text(&document)),
    };
    printed.map_err(CommandError::failure)?;
    Ok(match document.state {
        GraphState::Ok => Outcome::Done,
        _ => Outcome::Failed,
    })
}
