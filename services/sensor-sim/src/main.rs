//! `vigil-sensor-sim`: the simulated rover, recorded frames, or frames from a socket, as a process
//! of the graph. Exit codes: 0 stopped, 1 failed, 2 configuration, 3 a missed deadline under
//! `on_miss = "stop"`, 70 a failed assertion.

use std::process::ExitCode;
use std::rc::Rc;

use clap::Parser;
use vigil_blocks::Action;
use vigil_cycle::Topic;
use vigil_cycle::datagrams::Datagrams;
use vigil_cycle::serve::{self, ServeError, ServicePlan};
use vigil_cycle::topic::ServiceName;
use vigil_sensor_sim::{
    ListenAddresses, PlaybackSource, SensorSource, SimulatorSource, SocketInputs, SocketStage,
    VerdictNames, assemble,
};
use vigil_setup::{ServiceArgs, Setup};

/// The simulated rover, playback of recorded frames, and frames that arrive at a socket.
#[derive(Debug, Parser)]
#[command(version)]
struct Args {
    #[command(flatten)]
    service: ServiceArgs,
    /// Inject a fault or disturbance: `stuck:RM@5`, `tether:20@5` (seconds after the start).
    #[arg(long, value_name = "SPEC@T")]
    inject: Vec<String>,
    /// The drive began at this instant, ns of CLOCK_MONOTONIC: for a simulator that replaces one
    /// that died.
    #[arg(long, value_name = "NS")]
    began_ns: Option<u64>,
}

fn main() -> ExitCode {
    let args = Args::parse();
    let prepare = || {
        let setup = args.service.load()?;
        let source = assemble(&setup, &args.inject)?;
        Ok((setup, source))
    };
    let check = args.service.check;
    serve::process(ServiceName::SensorSim, check, prepare, |(setup, source)| {
        serve(&setup, source, &args)
    })
}

fn serve(setup: &Setup, source: SensorSource, args: &Args) -> Result<(), ServeError> {
    let plan = setup.plan(ServiceName::SensorSim, args.service.leave());
    let began_ns = args.began_ns;
    match source {
        SensorSource::Simulator(simulation, schedule) => {
            let (allow, period_ns) = (setup.file.control.allow_injection, setup.period_ns());
            serve::source(&plan, |graph| {
                let source = SimulatorSource::new(*simulation, schedule, allow, period_ns, graph)?;
                Ok(source.resuming(began_ns))
            })
        }
        SensorSource::Playback(playback) => serve::source(&plan, |graph| {
            PlaybackSource::new(playback, graph).map_err(ServeError::from)
        }),
        SensorSource::Socket(listen) => serve_socket(setup, &listen, plan),
    }
}

fn serve_socket(
    setup: &Setup,
    listen: &ListenAddresses,
    mut plan: ServicePlan,
) -> Result<(), ServeError> {
    // There is nothing to look at without a system call.
    plan.spin_ns = 0;
    serve::woken_by(&plan, |graph| {
        let datagrams = Datagrams::bind(listen.udp, listen.unix.as_deref())
            .map_err(|e| ServeError::Build(format!("sensor.socket: {e}")))?;
        let datagrams = Rc::new(datagrams);
        let actions = serve::listener::<Action>(graph, Topic::Action)?;
        let names = VerdictNames::new(
            setup.tree.nodes().iter().map(|node| node.name.as_str()),
            setup.decision.actions().iter().map(String::as_str),
        );
        let stage = SocketStage::new(Rc::clone(&datagrams), &setup.robot, names, graph)?;
        Ok((stage, SocketInputs { datagrams, actions }))
    })
}
