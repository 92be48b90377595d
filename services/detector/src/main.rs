//! `vigil-detector`: the detector as a process of the graph. Exit codes: 0 stopped, 1 failed,
//! 2 configuration.

use std::path::PathBuf;
use std::process::ExitCode;

use clap::Parser;
use vigil_blocks::SensorFrame;
use vigil_cycle::Topic;
use vigil_cycle::serve::{self, ServeError};
use vigil_cycle::topic::ServiceName;
use vigil_detector::{Detector, DetectorStage};
use vigil_robot::learned::Model;
use vigil_setup::{GraphArgs, Setup};

/// Detects any deviation from nominal behaviour.
#[derive(Debug, Parser)]
#[command(version, about)]
struct Args {
    #[command(flatten)]
    graph: GraphArgs,
    /// Where to leave the run report.
    #[arg(long, value_name = "F")]
    report: Option<PathBuf>,
}

fn main() -> ExitCode {
    let args = Args::parse();
    let (setup, detector) = match prepare(&args) {
        Ok(prepared) => prepared,
        Err(error) => {
            eprintln!("{error}");
            return ExitCode::from(2);
        }
    };
    let plan = setup.plan(ServiceName::Detector, args.report);
    let build = |graph: &_| DetectorStage::new(detector, graph).map_err(ServeError::from);
    match serve::stage::<SensorFrame, _>(&plan, Topic::Sensor, build) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("detector: {error}");
            ExitCode::from(1)
        }
    }
}

fn prepare(args: &Args) -> Result<(Setup, Detector), Box<dyn std::error::Error>> {
    let setup = args.graph.load()?;
    let model = Model::from_toml(&setup.model_text)
        .map_err(|e| format!("{}: {e}", setup.model_path.display()))?;
    let seed = setup.file.graph.seed;
    let detector = Detector::new(&model, &setup.robot, &setup.file.detector, seed)?;
    Ok((setup, detector))
}
