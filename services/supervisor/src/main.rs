//! `vigil-supervisor`: the supervisor as a process of the graph. Exit codes: 0 stopped, 1 failed,
//! 2 configuration.

use std::process::ExitCode;

use clap::Parser;
use vigil_blocks::FaultBelief;
use vigil_cycle::Topic;
use vigil_cycle::serve::{self, ServeError};
use vigil_cycle::topic::ServiceName;
use vigil_decision::Supervisor;
use vigil_setup::{ServiceArgs, Setup};
use vigil_supervisor::{SupervisorStage, assemble, validity_ns};

/// Decides what to do about a fault.
#[derive(Debug, Parser)]
#[command(version, about)]
struct Args {
    #[command(flatten)]
    service: ServiceArgs,
}

fn main() -> ExitCode {
    let args = Args::parse().service;
    let (setup, supervisor) = match prepare(&args) {
        Ok(prepared) => prepared,
        Err(error) => {
            eprintln!("{error}");
            return ExitCode::from(2);
        }
    };
    if args.check {
        return ExitCode::SUCCESS;
    }
    let plan = setup.plan(ServiceName::Supervisor, args.leave());
    let validity_ns = validity_ns(&setup);
    let build =
        |graph: &_| SupervisorStage::new(supervisor, graph, validity_ns).map_err(ServeError::from);
    match serve::stage::<FaultBelief, _>(&plan, Topic::Diagnosis, build) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("supervisor: {error}");
            ExitCode::from(error.exit_code())
        }
    }
}

fn prepare(args: &ServiceArgs) -> Result<(Setup, Supervisor), Box<dyn std::error::Error>> {
    let setup = args.load()?;
    let supervisor = assemble(&setup).map_err(|e| format!("{}: {e}", setup.path.display()))?;
    Ok((setup, supervisor))
}
