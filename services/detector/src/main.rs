//! `vigil-detector`: the detector as a process of the graph. Exit codes: 0 stopped, 1 failed,
//! 2 configuration.

use std::process::ExitCode;

use clap::Parser;
use vigil_blocks::SensorFrame;
use vigil_cycle::Topic;
use vigil_cycle::serve::{self, ServeError};
use vigil_cycle::topic::ServiceName;
use vigil_detector::{DetectorStage, assemble};
use vigil_diagnosis::detect::Detector;
use vigil_setup::{ServiceArgs, Setup};

/// Detects any deviation from nominal behaviour.
#[derive(Debug, Parser)]
#[command(version, about)]
struct Args {
    #[command(flatten)]
    service: ServiceArgs,
}

fn main() -> ExitCode {
    let args = Args::parse().service;
    let (setup, detector) = match prepare(&args) {
        Ok(prepared) => prepared,
        Err(error) => {
            eprintln!("{error}");
            return ExitCode::from(2);
        }
    };
    if args.check {
        return ExitCode::SUCCESS;
    }
    let plan = setup.plan(ServiceName::Detector, args.leave());
    let build =
        |graph: &_| DetectorStage::new(detector, &setup.robot, graph).map_err(ServeError::from);
    match serve::stage::<SensorFrame, _>(&plan, Topic::Sensor, build) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("detector: {error}");
            ExitCode::from(error.exit_code())
        }
    }
}

fn prepare(args: &ServiceArgs) -> Result<(Setup, Detector), Box<dyn std::error::Error>> {
    let setup = args.load()?;
    let detector = assemble(&setup).map_err(|e| format!("{}: {e}", setup.path.display()))?;
    Ok((setup, detector))
}
