//! What an operator says about faults: somebody knows; forget what is over.

use vigil_blocks::{Control, ControlCommand, FaultState};
use vigil_cycle::Topic;
use vigil_cycle::topic::ServiceName;
use vigil_setup::RunningArgs;
use vigil_terminal::{CommandError, Outcome};

use super::document::{Document, NamedFault};
use super::view::View;
use crate::command::send;

/// Acknowledges a fault: somebody knows of it.
///
/// One that is active stays until it is over; one that is over is cleared.
#[derive(Debug, clap::Args)]
pub struct AckArgs {
    #[command(flatten)]
    running: RunningArgs,
    /// Name or number of the fault, as `vigil faults` lists it; `all` for every one.
    #[arg(value_name = "FAULT")]
    fault: String,
}

/// Removes faults that are over from the list.
#[derive(Debug, clap::Args)]
pub struct ClearArgs {
    #[command(flatten)]
    running: RunningArgs,
}

/// Acknowledges.
///
/// # Errors
/// A fault that there is not, or that nobody has to acknowledge; a supervisor that does not answer.
pub fn acknowledge(args: &AckArgs) -> Result<Outcome, CommandError> {
    let mut view = View::join(&args.running)?;
    let document = view.first()?;
    let (number, name) = match args.fault.as_str() {
        "all" => (0, "all"),
        fault => {
            let fault = find(&document, fault)?;
            if fault.state == FaultState::Acknowledged.name() {
                let why = format!("{} is acknowledged already", fault.name);
                return Err(CommandError::failure(why));
            }
            (fault.number, fault.name.as_str())
        }
    };
    let number = u32::try_from(number).map_err(CommandError::failure)?;
    order(&view, ControlCommand::Acknowledge, number)?
        .then_some(())
        .ok_or_else(|| CommandError::failure(format!("{}: nothing to acknowledge", args.fault)))?;
    eprintln!("graph '{}': acknowledged {name}", document.graph());
    Ok(Outcome::Done)
}

/// Clears.
///
/// # Errors
/// As [`acknowledge`].
pub fn clear(args: &ClearArgs) -> Result<Outcome, CommandError> {
    let view = View::join(&args.running)?;
    let graph = view.graph_name();
    match order(&view, ControlCommand::Forget, 0)? {
        true => eprintln!("graph '{graph}': forgot the faults that were over"),
        false => eprintln!("graph '{graph}': no fault was over"),
    }
    Ok(Outcome::Done)
}

fn order(view: &View, command: ControlCommand, fault: u32) -> Result<bool, CommandError> {
    let topic = Topic::Control(ServiceName::Supervisor);
    let mut sender = view
        .graph
        .sender::<Control>(topic)
        .map_err(CommandError::failure)?;
    let block = sender.block();
    (block.command, block.fault) = (command as u32, fault);
    let answer = send(&view.graph, ServiceName::Supervisor, sender.as_mut())?;
    answer.ok_or_else(|| CommandError::failure("the supervisor does not answer"))
}

/// The fault of a name or number; of several of one name, the one that changed last.
fn find<'a>(document: &'a Document, fault: &str) -> Result<&'a NamedFault, CommandError> {
    let is_meant =
        |it: &&NamedFault| it.name.eq_ignore_ascii_case(fault) || it.number.to_string() == fault;
    document.faults.iter().find(is_meant).ok_or_else(|| {
        let names = document.faults.iter();
        let names: Vec<String> = names
            .map(|it| format!("{} ({})", it.name, it.number))
            .collect();
        let known = match names.is_empty() {
            true => "there are none".to_owned(),
            false => format!("there are {}", names.join(", ")),
        };
        CommandError::usage(format!("no fault '{fault}'; {known}"))
    })
}
