//! Who publishes frames in the virtual graph.

use vigil_blocks::SensorFrame;
use vigil_cycle::topic::ServiceName;
use vigil_cycle::{Graph, Sender, SourceCycle, Stamp, Topic, VirtualClock};
use vigil_sensor_sim::{SensorSource, SimulatorSource};
use vigil_setup::Setup;

use super::kobuki::Kobuki;

/// Where frames come from.
pub enum Publisher {
    /// The simulated rover.
    Rover(Box<SourceCycle>, Box<SimulatorSource>),
    /// A Kobuki.
    Kobuki(Box<dyn Sender<SensorFrame>>, Kobuki),
}

impl Publisher {
    pub fn new(setup: &Setup, graph: &Graph, inject: &[&str]) -> Self {
        if setup.robot.name == "kobuki" {
            let frames = graph.sender(Topic::Sensor).unwrap();
            return Self::Kobuki(frames, Kobuki::new(&setup.robot, inject, 1));
        }
        let inject: Vec<String> = inject.iter().map(|it| (*it).to_owned()).collect();
        let SensorSource::Simulator(simulation, schedule) =
            vigil_sensor_sim::assemble(setup, &inject).unwrap()
        else {
            unreachable!("the graph simulates");
        };
        let period_ns = setup.period_ns();
        let source = SimulatorSource::new(*simulation, schedule, true, period_ns, graph);
        let cycle = SourceCycle::new(
            super::account(setup, graph, ServiceName::SensorSim),
            period_ns,
        );
        Self::Rover(Box::new(cycle), Box::new(source.unwrap()))
    }

    /// Publishes a frame of another robot.
    pub fn spoil(&self, graph: &Graph, clock: &VirtualClock, t_ns: u64) {
        let mut frames = graph.sender::<SensorFrame>(Topic::Sensor).unwrap();
        frames.block().robot_hash = 1;
        let stamp = Stamp {
            t_schedule_ns: t_ns,
            t_capture_ns: t_ns,
        };
        frames.send(stamp, clock).unwrap();
    }

    /// Another start of the Kobuki's publisher.
    pub fn renew(&mut self, graph: &Graph) {
        if let Self::Kobuki(frames, ..) = self {
            *frames = graph.sender(Topic::Sensor).unwrap();
        }
    }

    pub fn turn(&mut self, clock: &VirtualClock, t_ns: u64) {
        match self {
            Self::Rover(cycle, source) => {
                assert!(cycle.turn(&mut **source, clock).unwrap().is_continue());
            }
            Self::Kobuki(frames, kobuki) => {
                kobuki.fill(frames.block(), t_ns as f64 * 1e-9);
                let stamp = Stamp {
                    t_schedule_ns: t_ns,
                    t_capture_ns: t_ns,
                };
                frames.send(stamp, clock).unwrap();
                frames.prepare().unwrap();
            }
        }
    }
}
