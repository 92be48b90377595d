//! `vigil inject`: breaks the simulated rover at run time, where the configuration permits it.

use vigil_blocks::{Control, ControlCommand};
use vigil_cycle::port::Link;
use vigil_cycle::topic::ServiceName;
use vigil_cycle::{Graph, Topic};
use vigil_robot::Injection;
use vigil_robot::disturbance_kind::PARAMETERS;
use vigil_setup::GraphArgs;

use vigil_terminal::{CommandError, Outcome};

use crate::command::send;

/// Breaks the simulated rover of a running graph, or mends it.
#[derive(Debug, clap::Args)]
pub struct Args {
    #[command(flatten)]
    graph: GraphArgs,
    /// What to break: `stuck:RM`, `encoder:LF:zero|frozen|noise`, or a disturbance, such as
    /// `tether:20`. `clear:RM` and `clear:all` mend it. An unknown kind prints the list of all.
    #[arg(value_name = "SPEC")]
    spec: String,
}

/// Sends the command and waits for the simulator's answer.
///
/// # Errors
/// A specification or configuration that is refused; no simulator that answers.
pub fn run(args: &Args) -> Result<Outcome, CommandError> {
    let setup = args.graph.load().map_err(CommandError::usage)?;
    let change = Injection::parse_change(&args.spec, &setup.robot).map_err(CommandError::usage)?;
    if !setup.file.control.allow_injection {
        let path = setup.path.display();
        let message = format!("{path}: control.allow_injection is false: injection is refused");
        return Err(CommandError::usage(message));
    }
    let domain = setup.domain().map_err(CommandError::failure)?;
    if domain.lock().map_err(CommandError::failure)?.is_some() {
        let name = domain.graph();
        return Err(CommandError::failure(format!(
            "no graph named '{name}' is running"
        )));
    }
    let link = Link::join(&domain, "vigil-inject").map_err(CommandError::failure)?;
    let graph = Graph::SharedMemory(link);
    let simulator = ServiceName::SensorSim;
    let mut sender = graph
        .sender::<Control>(Topic::Control(simulator))
        .map_err(CommandError::failure)?;
    let block = sender.block();
    let wire = change.to_wire();
    let command = match wire.injects {
        true => ControlCommand::Inject,
        false => ControlCommand::Clear,
    };
    (block.command, block.fault, block.wheel) = (command as u32, wire.kind, wire.place);
    block.parameter[..PARAMETERS].copy_from_slice(&wire.parameter);
    match send(&graph, simulator, sender.as_mut())? {
        Some(true) => {
            eprintln!("injected {}", args.spec);
            Ok(Outcome::Done)
        }
        Some(false) => Err(CommandError::failure("the simulator refused the injection")),
        None => Err(CommandError::failure("no simulator answered")),
    }
}
