//! `vigil-supervisor`: the supervisor as a process of the graph. Exit codes: 0 stopped, 1 failed,
//! 2 configuration.

use std::path::PathBuf;
use std::process::ExitCode;

use clap::Parser;
use vigil_blocks::FaultBelief;
use vigil_cycle::Topic;
use vigil_cycle::serve::{self, ServeError};
use vigil_cycle::topic::ServiceName;
use vigil_decision::Pomdp;
use vigil_robot::learned::Model;
use vigil_setup::{GraphArgs, Setup};
use vigil_supervisor::{Compensation, Supervisor, SupervisorStage};

/// Decides what to do about a fault.
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
    let (setup, supervisor) = match prepare(&args) {
        Ok(prepared) => prepared,
        Err(error) => {
            eprintln!("{error}");
            return ExitCode::from(2);
        }
    };
    let plan = setup.plan(ServiceName::Supervisor, args.report);
    let period_ns = plan.period_ns;
    let validity_ns = validity_ns(&setup);
    let build = |graph: &_| {
        SupervisorStage::new(supervisor, graph, period_ns, validity_ns).map_err(ServeError::from)
    };
    match serve::stage::<FaultBelief, _>(&plan, Topic::Diagnosis, build) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("supervisor: {error}");
            ExitCode::from(1)
        }
    }
}

fn prepare(args: &Args) -> Result<(Setup, Supervisor), Box<dyn std::error::Error>> {
    let setup = args.graph.load()?;
    let model = Model::from_toml(&setup.model_text)
        .map_err(|e| format!("{}: {e}", setup.model_path.display()))?;
    let decision = Pomdp::parse(&setup.decision_text)
        .map_err(|e| format!("{}: {e}", setup.decision_path.display()))?;
    let compensation = (0..setup.robot.wheels.len())
        .map(|wheel| {
            let (curvature_gain, curvature_offset_1_m) = model.compensation(wheel);
            Compensation {
                wheel,
                curvature_gain,
                curvature_offset_1_m,
            }
        })
        .collect();
    let settings = &setup.file.supervisor;
    let blind = (BLIND_NS / setup.period_ns()).max(BLIND_MISSES_MIN) as u32;
    let supervisor = Supervisor::new(
        decision,
        &setup.tree,
        &setup.robot,
        settings,
        compensation,
        blind,
    )?;
    Ok((setup, supervisor))
}

/// Without any belief the robot stops after this long, ns, and not before so many misses.
const BLIND_NS: u64 = 100_000_000;
const BLIND_MISSES_MIN: u64 = 5;

/// How long an action stays valid: long enough to survive a few lost cycles, short enough to stop
/// a robot whose supervisor is gone.
fn validity_ns(setup: &Setup) -> u64 {
    const VALIDITY_NS_MIN: f64 = 20e6;
    let periods = setup.file.supervisor.validity_periods;
    (periods * setup.period_ns() as f64).max(VALIDITY_NS_MIN) as u64
}
