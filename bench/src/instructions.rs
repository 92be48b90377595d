//! The four services over the in-process bus under the virtual clock: what the step of each takes
//! from the processor.
//!
//! Counted by callgrind between entry and return of the functions named in [`STEPS`]: instructions
//! do not depend on what else the machine does.

use std::error::Error;
use std::path::Path;

use vigil_cycle::placement::{PlacementRequest, read_back};
use vigil_cycle::port::Bus;
use vigil_cycle::serve::Leave;
use vigil_cycle::topic::ServiceName;
use vigil_cycle::{
    DeadlineMonitor, Graph, HealthBoard, PortError, SourceCycle, StageCycle, Topic, VirtualClock,
};
use vigil_detector::DetectorStage;
use vigil_identifier::IdentifierStage;
use vigil_sensor_sim::{SensorSource, SimulatorSource};
use vigil_setup::{GraphArgs, Setup};
use vigil_supervisor::SupervisorStage;

/// Each service and the functions that are its step, as callgrind names them.
pub const STEPS: [(&str, &[&str]); 4] = [
    (
        "sensor-sim",
        &["*Simulation::step*", "*Simulation::measure*"],
    ),
    ("detector", &["*detector::Detector::step*"]),
    ("identifier", &["*watcher::Diagnoser::step*"]),
    ("supervisor", &["*supervisor::Supervisor::step*"]),
];

/// Instant at which a wheel of the simulated rover sticks, s.
const STUCK_S: f64 = 3.0;

/// The graph in one thread.
pub struct InProcess {
    clock: VirtualClock,
    period_ns: u64,
    sensor: (SourceCycle, SimulatorSource),
    detector: (StageCycle, DetectorStage),
    identifier: (StageCycle, IdentifierStage),
    supervisor: (StageCycle, SupervisorStage),
}

impl InProcess {
    /// The default graph, one of whose rover's wheels will stick.
    ///
    /// # Errors
    /// If the default graph cannot be read or does not simulate.
    pub fn new() -> Result<Self, Box<dyn Error>> {
        use ServiceName::{Detector, Identifier, SensorSim, Supervisor};
        let config = Path::new(env!("CARGO_MANIFEST_DIR")).join("../config/rover.toml");
        let setup = GraphArgs {
            config,
            ..GraphArgs::default()
        }
        .load()?;
        let period_ns = setup.period_ns();
        let clock = VirtualClock::default();
        let graph = Graph::InProcess(Bus::new(clock.clone()));
        let stage = |name| -> Result<StageCycle, Box<dyn Error>> {
            let (monitor, board) = parts(&setup, &graph, name)?;
            Ok(StageCycle::new(monitor, board)?)
        };
        let inject = [format!("stuck:RM@{STUCK_S}")];
        let SensorSource::Simulator(simulation, drive) =
            vigil_sensor_sim::assemble(&setup, &inject)?
        else {
            return Err("the default graph does not simulate".into());
        };
        let sensor = SimulatorSource::new(*simulation, drive, true, period_ns, &graph)?;
        let (monitor, board) = parts(&setup, &graph, SensorSim)?;
        let detector = DetectorStage::new(vigil_detector::assemble(&setup)?, &setup.robot, &graph)?;
        let identifier = vigil_identifier::assemble(&setup)?;
        let identifier = IdentifierStage::new(identifier, &setup.robot, &graph)?;
        let supervisor = vigil_supervisor::assemble(&setup)?;
        let validity_ns = vigil_supervisor::validity_ns(&setup);
        let supervisor = SupervisorStage::new(supervisor, &graph, validity_ns)?;
        clock.set(period_ns);
        let mut found = Self {
            sensor: (SourceCycle::new(monitor, board, period_ns)?, sensor),
            detector: (stage(Detector)?, detector),
            identifier: (stage(Identifier)?, identifier),
            supervisor: (stage(Supervisor)?, supervisor),
            period_ns,
            clock,
        };
        found.detector.0.ready(&found.clock)?;
        found.identifier.0.ready(&found.clock)?;
        found.supervisor.0.ready(&found.clock)?;
        Ok(found)
    }

    /// Runs `cycles` cycles.
    ///
    /// # Errors
    /// The ports'; over the in-process bus none.
    pub fn run(&mut self, cycles: u64) -> Result<(), PortError> {
        for cycle in 1..=cycles {
            self.clock.set(cycle * self.period_ns);
            let Self {
                clock,
                sensor,
                detector,
                identifier,
                supervisor,
                ..
            } = self;
            let _ = sensor.0.turn(&mut sensor.1, clock)?;
            let _ = detector.0.turn(&mut detector.1, clock)?;
            let _ = identifier.0.turn(&mut identifier.1, clock)?;
            let _ = supervisor.0.turn(&mut supervisor.1, clock)?;
        }
        Ok(())
    }

    /// Cycles that the supervisor has answered.
    #[must_use]
    pub const fn cycles(&self) -> u64 {
        self.supervisor.0.health().view().cycles
    }
}

fn parts(
    setup: &Setup,
    graph: &Graph,
    name: ServiceName,
) -> Result<(DeadlineMonitor, HealthBoard), PortError> {
    let schedule = setup.plan(name, Leave::default()).schedule;
    let wanted = PlacementRequest {
        core: 0,
        priority: 1,
    };
    let sender = graph.sender(Topic::Health(name))?;
    let board = HealthBoard::new(sender, schedule, wanted, read_back(0));
    Ok((DeadlineMonitor::new(schedule), board))
}
