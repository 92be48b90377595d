//! `vigil-supervisor`: the supervisor as a process of the graph. Exit codes: 0 stopped, 1 failed,
//! 2 configuration, 3 a missed deadline under `on_miss = "stop"`, 70 a failed assertion.

use std::process::ExitCode;

use clap::Parser;
use vigil_blocks::FaultBelief;
use vigil_cycle::Topic;
use vigil_cycle::serve;
use vigil_cycle::topic::ServiceName;
use vigil_setup::ServiceArgs;
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
    serve::process(
        ServiceName::Supervisor,
        args.check,
        || args.prepare(assemble),
        |(setup, supervisor)| {
            let plan = setup.plan(ServiceName::Supervisor, args.leave());
            serve::stage::<FaultBelief, _>(&plan, Topic::Diagnosis, |graph| {
                Ok(SupervisorStage::new(
                    supervisor,
                    graph,
                    validity_ns(&setup),
                )?)
            })
        },
    )
}
