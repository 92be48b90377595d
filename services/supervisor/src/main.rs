//! `vigil-supervisor`: the supervisor as a process of the graph. Exit codes: 0 stopped, 1 failed,
//! 2 configuration, 3 a missed deadline under `on_miss = "stop"`, 70 a failed assertion.

use std::process::ExitCode;

use clap::Parser;
use vigil_blocks::FaultBelief;
use vigil_cycle::serve;
use vigil_cycle::topic::ServiceName;
use vigil_cycle::{KeptBlock, Monotonic, Topic};
use vigil_setup::ServiceArgs;
use vigil_supervisor::{SupervisorStage, steps, validity_ns};

/// Decides what to do about a fault.
#[derive(Debug, Parser)]
#[command(version)]
struct Args {
    #[command(flatten)]
    service: ServiceArgs,
}

fn main() -> ExitCode {
    let args = Args::parse().service;
    serve::process(
        ServiceName::Supervisor,
        args.check,
        || args.prepare(steps),
        |(setup, steps)| {
            let plan = setup.plan(ServiceName::Supervisor, args.leave());
            serve::stage::<FaultBelief, _>(&plan, Topic::Diagnosis, |graph| {
                let file = setup.domain()?.faults_file();
                // Without it a supervisor that replaces this one begins without faults.
                let kept = KeptBlock::open(&file)
                    .inspect_err(|error| eprintln!("supervisor: {}: {error}", file.display()));
                let (kept, valid_ns) = (kept.ok(), validity_ns(&setup));
                let stage = SupervisorStage::new(steps, graph, valid_ns, kept, &Monotonic);
                Ok(stage?)
            })
        },
    )
}
