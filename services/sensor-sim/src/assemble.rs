//! From the configuration to a source of frames.

use std::error::Error;
use std::path::Path;

use vigil_recording::frames;
use vigil_robot::{ChannelMap, Injection};
use vigil_setup::Setup;
use vigil_setup::graph_file::Source;

use crate::action_gate::ActionGate;
use crate::injection_schedule::InjectionSchedule;
use crate::navigation::Navigator;
use crate::playback::Playback;
use crate::simulation::Simulation;
use crate::wiring::ListenAddresses;
use crate::world::World;

/// What is to be the source of the graph.
pub enum SensorSource {
    /// The simulated rover, and what is to break when.
    Simulator(Box<Simulation>, InjectionSchedule),
    /// Recorded frames.
    Playback(Playback),
    /// Frames that arrive as datagrams.
    Socket(ListenAddresses),
}

/// The source that a configuration describes; `injections` (`stuck:RM@5`) break it.
///
/// # Errors
/// What does not fit, with the file, key or option in which it lies.
pub fn assemble(setup: &Setup, injections: &[String]) -> Result<SensorSource, Box<dyn Error>> {
    let (file, path) = (&setup.file, setup.path.display());
    let schedule = schedule(setup, injections)?;
    Ok(match file.sensor.source {
        Source::Simulator => {
            let (rate_hz, seed) = (file.graph.rate_hz, file.graph.seed);
            let world = World::new(&setup.robot, &file.simulator, &file.drive, rate_hz, seed)
                .map_err(|e| format!("{path}: simulator: {e}"))?;
            let gate = ActionGate::new(&setup.robot.limits);
            let navigator = file.navigation.as_ref();
            let navigator = navigator.map(|it| Navigator::new(it, ChannelMap::new(&setup.robot)));
            let simulation = Simulation::new(world, gate, navigator);
            SensorSource::Simulator(Box::new(simulation), schedule)
        }
        Source::Playback => SensorSource::Playback(playback(setup)?),
        Source::Socket => SensorSource::Socket(listen(setup)?),
        Source::External => {
            return Err(format!("{path}: sensor.source is external: nothing to simulate").into());
        }
    })
}

fn schedule(setup: &Setup, specs: &[String]) -> Result<InjectionSchedule, Box<dyn Error>> {
    if !specs.is_empty() && setup.file.sensor.source != Source::Simulator {
        return Err("--inject: only the simulator can be broken; the source is another".into());
    }
    if !specs.is_empty() && !setup.file.control.allow_injection {
        let path = setup.path.display();
        let refused = format!("{path}: control.allow_injection is false: --inject is refused");
        return Err(refused.into());
    }
    let parse = |spec: &String| {
        Injection::parse(spec, &setup.robot).map_err(|e| format!("--inject {spec}: {e}"))
    };
    Ok(InjectionSchedule::new(
        specs.iter().map(parse).collect::<Result<_, _>>()?,
    ))
}

fn listen(setup: &Setup) -> Result<ListenAddresses, Box<dyn Error>> {
    let socket = &setup.file.sensor.socket;
    let udp = socket
        .udp_address()
        .map_err(|e| format!("sensor.socket.udp: {e}"))?;
    let unix = match socket.unix.as_str() {
        "" => None,
        name => Some(setup.domain()?.folder().join(name)),
    };
    Ok(ListenAddresses { udp, unix })
}

fn playback(setup: &Setup) -> Result<Playback, Box<dyn Error>> {
    let sensor = &setup.file.sensor;
    let frames = sensor.frames.as_deref().ok_or("sensor.frames is missing")?;
    let path = setup.resolve(frames);
    let runs = frames::read(&path, &setup.robot)?;
    let runs = chosen(runs, sensor.runs.as_deref(), setup, &path)?;
    Ok(Playback::new(runs).map_err(|e| format!("{}: {e}", path.display()))?)
}

/// The runs that `sensor.runs` names, in its request.
fn chosen(
    mut runs: Vec<frames::Run>,
    wanted: Option<&str>,
    setup: &Setup,
    path: &Path,
) -> Result<Vec<frames::Run>, String> {
    match wanted {
        None | Some("all") => {}
        Some("heldout") => {
            let held_out = &setup.model.provenance().runs_held_out;
            runs.retain(|run| held_out.contains(&run.id));
            if runs.is_empty() {
                let (path, model) = (path.display(), setup.model_path.display());
                return Err(format!("{path}: no run in it was held out of {model}"));
            }
        }
        Some(list) => {
            let ids = list.split(',').map(|id| id.trim().parse());
            let wanted: Vec<u32> = ids
                .collect::<Result<_, _>>()
                .map_err(|_| format!("'{list}' is not a list of runs"))?;
            if let Some(id) = wanted.iter().find(|id| !runs.iter().any(|r| r.id == **id)) {
                return Err(format!("{}: there is no run {id}", path.display()));
            }
            runs.retain(|run| wanted.contains(&run.id));
            runs.sort_by_key(|run| wanted.iter().position(|id| *id == run.id));
        }
    }
    Ok(runs)
}
