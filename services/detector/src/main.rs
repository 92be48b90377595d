//! `vigil-detector`: the detector as a process of the graph. Exit codes: 0 stopped, 1 failed,
//! 2 configuration, 3 a missed deadline under `on_miss = "stop"`, 70 a failed assertion.

use std::process::ExitCode;

use clap::Parser;
use vigil_blocks::SensorFrame;
use vigil_cycle::Topic;
use vigil_cycle::serve;
use vigil_cycle::topic::ServiceName;
use vigil_detector::{DetectorStage, assemble};
use vigil_setup::ServiceArgs;

/// Detects any deviation from nominal behaviour.
#[derive(Debug, Parser)]
#[command(version)]
struct Args {
    #[command(flatten)]
    service: ServiceArgs,
}

fn main() -> ExitCode {
    let args = Args::parse().service;
    serve::process(
        ServiceName::Detector,
        args.check,
        || args.prepare(assemble),
        |(setup, detector)| {
            let plan = setup.plan(ServiceName::Detector, args.leave());
            serve::stage::<SensorFrame, _>(&plan, Topic::Sensor, |graph| {
                Ok(DetectorStage::new(detector, &setup.robot, graph)?)
            })
        },
    )
}
