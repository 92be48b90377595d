//! `vigil inject`: breaks the simulated rover at run time, where the configuration permits it.

use vigil_blocks::{Control, ControlCommand};
use vigil_cycle::port::Link;
use vigil_cycle::topic::ServiceName;
use vigil_cycle::{Graph, Topic};
use vigil_robot::Injection;
use vigil_robot::disturbance_kind::PARAMETERS;
use vigil_robot::injection::forms;
use vigil_setup::RunningArgs;

use vigil_terminal::{CommandError, Outcome, output};

use crate::command::send;

/// Breaks the simulated rover of a running graph, or mends it.
#[derive(Debug, clap::Args)]
pub struct Args {
    #[command(flatten)]
    running: RunningArgs,
    /// What to break: `stuck:RM`, `encoder:LF:zero|frozen|noise`, or a disturbance, such as
    /// `tether:20`. `clear:RM` and `clear:all` mend it.
    #[arg(value_name = "SPEC", required_unless_present = "list")]
    spec: Option<String>,
    /// List what can be injected; no graph need run.
    #[arg(long, conflicts_with = "spec")]
    list: bool,
}

/// Sends the command and waits for the simulator's answer.
///
/// # Errors
/// A specification or configuration that is refused; no simulator that answers.
pub fn run(args: &Args) -> Result<Outcome, CommandError> {
    let Some(spec) = &args.spec else {
        let forms = forms();
        let lines = forms
            .iter()
            .map(|[form, about]| format!("{form}\n    {about}"));
        let lines: Vec<String> = lines.collect();
        output::line(&lines.join("\n")).map_err(CommandError::failure)?;
        return Ok(Outcome::Done);
    };
    let running = args.running.find().map_err(CommandError::failure)?;
    let setup = &running.setup;
    let change = Injection::parse_change(spec, &setup.robot).map_err(CommandError::usage)?;
    if !setup.file.control.allow_injection {
        let path = setup.path.display();
        let message = format!("{path}: control.allow_injection is false: injection is refused");
        return Err(CommandError::usage(message));
    }
    let link = Link::join(&running.domain, "vigil-inject").map_err(CommandError::failure)?;
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
            let graph = running.domain.graph();
            eprintln!("graph '{graph}': injected {spec}");
            Ok(Outcome::Done)
        }
        Some(false) => Err(CommandError::failure("the simulator refused the injection")),
        None => Err(CommandError::failure("no simulator answered")),
    }
}
