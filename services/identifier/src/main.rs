//! `vigil-identifier`: the identifier as a process of the graph. Exit codes: 0 stopped, 1 failed,
//! 2 configuration.

use std::path::PathBuf;
use std::process::ExitCode;

use clap::Parser;
use vigil_blocks::DetectionBelief;
use vigil_cycle::Topic;
use vigil_cycle::serve::{self, ServeError};
use vigil_cycle::topic::ServiceName;
use vigil_identifier::{Identifier, IdentifierStage};
use vigil_robot::learned::Model;
use vigil_setup::{GraphArgs, Setup};

/// Identifies the fault.
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
    let (setup, identifier) = match prepare(&args) {
        Ok(prepared) => prepared,
        Err(error) => {
            eprintln!("{error}");
            return ExitCode::from(2);
        }
    };
    let plan = setup.plan(ServiceName::Identifier, args.report);
    let period_ns = plan.period_ns;
    let build =
        |graph: &_| IdentifierStage::new(identifier, graph, period_ns).map_err(ServeError::from);
    match serve::stage::<DetectionBelief, _>(&plan, Topic::Detection, build) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("identifier: {error}");
            ExitCode::from(1)
        }
    }
}

fn prepare(args: &Args) -> Result<(Setup, Identifier), Box<dyn std::error::Error>> {
    let setup = args.graph.load()?;
    let model = Model::from_toml(&setup.model_text)
        .map_err(|e| format!("{}: {e}", setup.model_path.display()))?;
    let file = &setup.file;
    let (settings, sensors) = (&file.identifier, file.detector.sensors);
    let seed = file.graph.seed;
    let identifier = Identifier::new(&model, &setup.robot, &setup.tree, settings, sensors, seed)?;
    Ok((setup, identifier))
}
