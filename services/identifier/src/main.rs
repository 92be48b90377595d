//! `vigil-identifier`: the identifier as a process of the graph. Exit codes: 0 stopped, 1 failed,
//! 2 configuration.

use std::process::ExitCode;

use clap::Parser;
use vigil_blocks::DetectionBelief;
use vigil_cycle::Topic;
use vigil_cycle::serve::{self, ServeError};
use vigil_cycle::topic::ServiceName;
use vigil_diagnosis::identify::Diagnoser;
use vigil_identifier::{IdentifierStage, assemble};
use vigil_setup::{ServiceArgs, Setup};

/// Identifies the fault.
#[derive(Debug, Parser)]
#[command(version, about)]
struct Args {
    #[command(flatten)]
    service: ServiceArgs,
}

fn main() -> ExitCode {
    let args = Args::parse().service;
    let (setup, identifier) = match prepare(&args) {
        Ok(prepared) => prepared,
        Err(error) => {
            eprintln!("{error}");
            return ExitCode::from(2);
        }
    };
    if args.check {
        return ExitCode::SUCCESS;
    }
    let plan = setup.plan(ServiceName::Identifier, args.leave());
    let build =
        |graph: &_| IdentifierStage::new(identifier, &setup.robot, graph).map_err(ServeError::from);
    match serve::stage::<DetectionBelief, _>(&plan, Topic::Detection, build) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("identifier: {error}");
            ExitCode::from(error.exit_code())
        }
    }
}

fn prepare(args: &ServiceArgs) -> Result<(Setup, Diagnoser), Box<dyn std::error::Error>> {
    let setup = args.load()?;
    let identifier = assemble(&setup).map_err(|e| format!("{}: {e}", setup.path.display()))?;
    Ok((setup, identifier))
}
