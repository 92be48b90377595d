//! `vigil-sensor-sim`: the simulated rover, or recorded frames, as a process of the graph. Exit
//! codes: 0 stopped, 1 failed, 2 configuration.

use std::path::PathBuf;
use std::process::ExitCode;

use clap::Parser;
use vigil_cycle::serve::{self, Plan, ServeError};
use vigil_cycle::topic::ServiceName;
use vigil_evaluation::frames;
use vigil_robot::Injection;
use vigil_robot::learned::Model;
use vigil_sensor_sim::{Obedience, Playback, PlaybackSource, Schedule, SimulatorSource, World};
use vigil_setup::schema::Source;
use vigil_setup::{GraphArgs, Setup};

/// The simulated rover, and playback of recorded frames.
#[derive(Debug, Parser)]
#[command(version, about)]
struct Args {
    #[command(flatten)]
    graph: GraphArgs,
    /// Inject a fault: `stuck:RM@5` (seconds after the start).
    #[arg(long, value_name = "SPEC@T")]
    inject: Vec<String>,
    /// Where to leave the run report.
    #[arg(long, value_name = "F")]
    report: Option<PathBuf>,
}

/// What is to be the source.
enum Prepared {
    Simulator(Box<World>, Schedule),
    Playback(Playback),
}

fn main() -> ExitCode {
    let args = Args::parse();
    let (setup, prepared) = match prepare(&args) {
        Ok(prepared) => prepared,
        Err(error) => {
            eprintln!("{error}");
            return ExitCode::from(2);
        }
    };
    let plan = setup.plan(ServiceName::SensorSim, args.report);
    match serve(&setup, &plan, prepared) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("sensor-sim: {error}");
            ExitCode::from(1)
        }
    }
}

fn prepare(args: &Args) -> Result<(Setup, Prepared), Box<dyn std::error::Error>> {
    let setup = args.graph.load()?;
    let file = &setup.file;
    let prepared = match file.sensor.source {
        Source::Simulator => {
            let injections = args
                .inject
                .iter()
                .map(|spec| Injection::parse(spec, &setup.robot));
            let schedule = Schedule::new(injections.collect::<Result<_, _>>()?);
            let (rate_hz, seed) = (file.graph.rate_hz, file.graph.seed);
            let world = World::new(&setup.robot, &file.simulator, &file.drive, rate_hz, seed)?;
            Prepared::Simulator(Box::new(world), schedule)
        }
        Source::Playback => Prepared::Playback(playback(&setup)?),
        Source::External => return Err("sensor.source is external: nothing to simulate".into()),
    };
    Ok((setup, prepared))
}

fn playback(setup: &Setup) -> Result<Playback, Box<dyn std::error::Error>> {
    let sensor = &setup.file.sensor;
    let frames = sensor.frames.as_deref().ok_or("sensor.frames is missing")?;
    let path = setup.resolve(frames);
    let mut runs = frames::read(&path, &setup.robot)?;
    match sensor.runs.as_deref() {
        None | Some("all") => {}
        Some("heldout") => {
            let model = Model::from_toml(&setup.model_text)?;
            runs.retain(|run| model.provenance.runs_held_out.contains(&run.id));
        }
        Some(list) => {
            let wanted: Vec<u32> = list
                .split(',')
                .filter_map(|id| id.trim().parse().ok())
                .collect();
            if let Some(id) = wanted
                .iter()
                .find(|id| !runs.iter().any(|run| run.id == **id))
            {
                return Err(format!("{}: there is no run {id}", path.display()).into());
            }
            runs.retain(|run| wanted.contains(&run.id));
            runs.sort_by_key(|run| wanted.iter().position(|id| *id == run.id));
        }
    }
    Ok(Playback::new(runs, sensor.speed.unwrap_or(1.0))?)
}

fn serve(setup: &Setup, plan: &Plan, prepared: Prepared) -> Result<(), ServeError> {
    match prepared {
        Prepared::Simulator(world, schedule) => {
            let obedience = Obedience::new(&setup.robot.limits);
            let allow = setup.file.control.allow_injection;
            let period_ns = plan.period_ns;
            serve::source(plan, |graph| {
                let source =
                    SimulatorSource::new(*world, obedience, schedule, allow, period_ns, graph);
                source.map_err(ServeError::from)
            })
        }
        Prepared::Playback(playback) => serve::source(plan, |graph| {
            PlaybackSource::new(playback, graph).map_err(ServeError::from)
        }),
    }
}
