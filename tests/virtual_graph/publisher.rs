//! Who publishes frames in the virtual graph.

use rand::{RngExt, SeedableRng};
use rand_distr::StandardNormal;
use rand_pcg::Pcg64Mcg;
use vigil_blocks::SensorFrame;
use vigil_cycle::topic::ServiceName;
use vigil_cycle::{Graph, Sender, SourceCycle, Stamp, Topic, VirtualClock};
use vigil_sensor_sim::{SensorSource, SimulatorSource};
use vigil_setup::Setup;

/// Where frames come from.
pub enum Publisher {
    /// The simulated rover.
    Rover(Box<SourceCycle>, Box<SimulatorSource>),
    /// A Kobuki by its geometry, whose left wheel sticks.
    Kobuki(Box<dyn Sender<SensorFrame>>, u64, Pcg64Mcg),
}

impl Publisher {
    /// From then on the Kobuki's left wheel stands, s.
    pub const KOBUKI_STUCK_S: f64 = 30.0;

    pub fn new(setup: &Setup, graph: &Graph, inject: &[&str]) -> Self {
        if setup.robot.name == "kobuki" {
            let frames = graph.sender(Topic::Sensor).unwrap();
            let hash = vigil_robot::channel::hash(&setup.robot);
            return Self::Kobuki(frames, hash, Pcg64Mcg::seed_from_u64(1));
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
            Self::Kobuki(frames, hash, rng) => {
                let t_s = t_ns as f64 * 1e-9;
                let frame = frames.block();
                (frame.run_id, frame.robot_hash) = (1, *hash);
                kobuki(frame, t_s, rng);
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

/// Drives about.
fn kobuki(frame: &mut SensorFrame, t_s: f64, rng: &mut Pcg64Mcg) {
    let mut noise = |sd: f64| sd * rng.sample::<f64, _>(StandardNormal);
    frame.set_command(0, 0.25 + 0.1 * (0.5 * t_s).sin());
    frame.set_command(1, 0.5 * (0.37 * t_s).sin());
    for (wheel, side) in [(0, -1.0), (1, 1.0)] {
        let stands = wheel == 0 && t_s > Publisher::KOBUKI_STUCK_S;
        let speed = frame.command[0] + side * 0.115 * frame.command[1];
        let rate = if stands { 0.0 } else { speed / 0.035 };
        frame.set_channel(wheel, rate + noise(0.1));
        frame.set_channel(3 + wheel, 0.03 + noise(0.005));
    }
    let difference = frame.channel[1] - frame.channel[0];
    frame.set_channel(2, difference * 0.035 / 0.23 + noise(0.02));
}
