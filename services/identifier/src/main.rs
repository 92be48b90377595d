//! `vigil-identifier`: the identifier as a process of the graph. Exit codes: 0 stopped, 1 failed,
//! 2 configuration, 3 a missed deadline under `on_miss = "stop"`, 70 a failed assertion.

use std::process::ExitCode;

use clap::Parser;
use vigil_blocks::DetectionBelief;
use vigil_cycle::Topic;
use vigil_cycle::serve;
use vigil_cycle::topic::ServiceName;
use vigil_identifier::{IdentifierStage, assemble};
use vigil_setup::ServiceArgs;

/// Identifies the fault.
#[derive(Debug, Parser)]
#[command(version)]
struct Args {
    #[command(flatten)]
    service: ServiceArgs,
}

fn main() -> ExitCode {
    let args = Args::parse().service;
    serve::process(
        ServiceName::Identifier,
        args.check,
        || args.prepare(assemble),
        |(setup, identifier)| {
            let plan = setup.plan(ServiceName::Identifier, args.leave());
            serve::stage::<DetectionBelief, _>(&plan, Topic::Detection, |graph| {
                Ok(IdentifierStage::new(identifier, &setup.robot, graph)?)
            })
        },
    )
}
