//! Writes a short flight of a rover whose wheel gets stuck: `write_flight [file] [graph file]`.
//!
//! Nothing runs: the blocks are made up, with the shapes that a graph's have.

use std::collections::BTreeMap;
use std::error::Error;
use std::path::PathBuf;

use vigil_blocks::{
    Action, Block, Cause, CauseKind, DetectionBelief, EVIDENCE, Event, EventKind, FaultBelief,
    FaultRecord, FaultSet, FaultSource, FaultState, Faults, Header, Health, MODE_UNKNOWN,
    OverallState, ParticleBlock, SensorFrame, ServiceState, Severity, SizeKind, Truth,
    WeightedHypothesis,
};
use vigil_cycle::topic::{ServiceName, Topic};
use vigil_flight::{FlightError, FlightWriter};
use vigil_robot::channel::{Role, channels, hash};
use vigil_setup::{Document, Setup};
use vigil_timeline::{Timeline, WallClock};

const PERIOD_NS: u64 = 50_000_000;
const CYCLES: u64 = 100;
/// Cycle in which the wheel gets stuck.
const ONSET: u64 = 60;
/// When the drive began by `CLOCK_MONOTONIC`, and by the calendar (14 November 2023).
const BEGIN_NS: u64 = 5_000_000_000;
const AHEAD_NS: i128 = 1_700_000_000_000_000_000;

/// One instant of the drive.
struct Instant {
    cycle: u64,
    t_s: f64,
    /// Probability that the wheel is stuck.
    p: f64,
}

impl Instant {
    fn new(cycle: u64) -> Self {
        let since = cycle.saturating_sub(ONSET) as f64;
        Self {
            cycle,
            t_s: (cycle * PERIOD_NS) as f64 * 1e-9,
            p: 0.999 * (1.0 - (-0.3 * since).exp()) + 1e-4,
        }
    }

    fn is_broken(&self) -> bool {
        self.cycle >= ONSET
    }

    fn captured_ns(&self) -> u64 {
        BEGIN_NS + self.cycle * PERIOD_NS
    }

    /// A block's head; blocks follow each other by 100 µs for each `stage`.
    fn header<B: Block>(&self, stage: u64) -> Header {
        Header {
            schema: B::SCHEMA,
            epoch: 7,
            seq: self.cycle,
            t_schedule_ns: self.captured_ns(),
            t_capture_ns: self.captured_ns(),
            t_publish_ns: self.captured_ns() + 100_000 * (stage + 1),
        }
    }

    fn cause(&self) -> Cause {
        Cause {
            kind: CauseKind::Frame as u32,
            count: 1,
            frame_epoch: 7,
            frame_seq: self.cycle,
        }
    }

    /// On a circle of 2 m.
    fn pose(&self) -> [f64; 3] {
        let yaw = 0.1 * self.t_s;
        [2.0 * yaw.sin(), 2.0 - 2.0 * yaw.cos(), yaw]
    }

    fn frame(&self, graph: &Setup) -> SensorFrame {
        let mut frame = SensorFrame {
            header: self.header::<SensorFrame>(0),
            run_id: 1,
            robot_hash: hash(&graph.robot),
            ..SensorFrame::default()
        };
        frame.set_command(0, 0.5);
        frame.set_command(1, 0.2);
        let [x, y, yaw] = self.pose();
        for (place, channel) in channels(&graph.robot).iter().enumerate() {
            let wheel = channel.wheel.unwrap_or_default() as f64;
            match channel.role {
                Role::PoseX => frame.set_channel(place, x),
                Role::PoseY => frame.set_channel(place, y),
                Role::PoseYaw => frame.set_channel(place, yaw),
                // The first wheel's encoder is silent now and then.
                Role::WheelRate if wheel == 0.0 && self.cycle % 10 == 9 => {}
                Role::WheelRate => frame.set_channel(place, 2.0 + 0.1 * wheel + 0.01 * self.t_s),
                Role::SteeringAngle => frame.set_channel(place, 0.05 * wheel - 0.1),
                _ => {}
            }
        }
        frame
    }

    fn truth(&self) -> Truth {
        Truth {
            header: self.header::<Truth>(1),
            cause: self.cause(),
            run_id: 1,
            pose: self.pose(),
            velocity: [0.2, 0.0, 0.1],
            is_disturbed: self.is_broken().into(),
            ..Truth::default()
        }
    }

    fn detection(&self) -> DetectionBelief {
        let log_odds = (self.p / (1.0 - self.p)).ln();
        DetectionBelief {
            header: self.header::<DetectionBelief>(2),
            cause: self.cause(),
            p_fault: self.p,
            log_odds,
            alarm_log_odds: 3.0,
            channel_log_odds: std::array::from_fn(|at| log_odds - 0.1 * at as f64),
            alarm: (log_odds > 3.0).into(),
            ..DetectionBelief::default()
        }
    }

    fn particles(&self) -> ParticleBlock {
        let mut block = ParticleBlock {
            header: self.header::<ParticleBlock>(2),
            cause: self.cause(),
            count: 1,
            ..ParticleBlock::default()
        };
        block.hypotheses[0] = WeightedHypothesis {
            pose: self.pose(),
            ..WeightedHypothesis::default()
        };
        block
    }

    fn diagnosis(&self, graph: &Setup, node: usize) -> FaultBelief {
        let mode = if self.p > 0.5 { node as u32 } else { 0 };
        let mut belief = FaultBelief {
            header: self.header::<FaultBelief>(3),
            cause: self.cause(),
            tree_hash: graph.tree.hash(),
            p_unknown: 5e-5,
            p_mode: self.p.max(1.0 - self.p),
            mode,
            reported: mode,
            runner_up: MODE_UNKNOWN,
            node_count: graph.tree.nodes().len() as u32,
            set_count: 1,
            ..FaultBelief::default()
        };
        (belief.p[0], belief.p[node]) = (1.0 - self.p - belief.p_unknown, self.p);
        belief.sets[0] = FaultSet {
            leaves: u64::from(mode != 0) << node,
            p: belief.p_mode,
        };
        belief.size_kind[node] = SizeKind::Gain as u32;
        (belief.size[node], belief.size_sd[node]) = (0.25, 0.01);
        if mode != 0 {
            belief.channel_evidence = [0.5; EVIDENCE];
            belief.channel_evidence[4] = 12.5;
        }
        belief
    }

    fn action(&self, graph: &Setup) -> Action {
        let states = graph.decision.states().len();
        let mut action = Action {
            header: self.header::<Action>(4),
            cause: self.cause(),
            decision_seq: 1 + u64::from(self.is_broken()),
            model_hash: graph.decision.hash(),
            action: self.is_broken().into(),
            state_count: states as u32,
            ..Action::default()
        };
        (action.belief[0], action.belief[1]) = (1.0 - self.p, self.p);
        action
    }

    fn faults(&self, graph: &Setup, node: usize) -> Faults {
        let mut faults = Faults {
            header: self.header::<Faults>(5),
            tree_hash: graph.tree.hash(),
            revision: self.is_broken().into(),
            fault_count: self.is_broken().into(),
            overall: OverallState::Ok as u32,
            ..Faults::default()
        };
        if self.is_broken() {
            faults.overall = OverallState::Fault as u32;
            faults.records[0] = FaultRecord {
                number: 1,
                p: self.p,
                source: FaultSource::Robot as u32,
                what: node as u32,
                state: FaultState::Active as u32,
                severity: Severity::Fault as u32,
                count: 1,
                ..FaultRecord::default()
            };
        }
        faults
    }

    fn health(&self) -> Health {
        Health {
            header: self.header::<Health>(6),
            cycles: self.cycle,
            worst_cycle_ns: 12_300,
            state: ServiceState::Running as u32,
            ..Health::default()
        }
    }

    fn write(
        &self,
        flight: &mut FlightWriter,
        graph: &Setup,
        node: usize,
    ) -> Result<(), FlightError> {
        use bytemuck::bytes_of;
        flight.block(Topic::Sensor, bytes_of(&self.frame(graph)))?;
        flight.block(Topic::Truth, bytes_of(&self.truth()))?;
        flight.block(Topic::Detection, bytes_of(&self.detection()))?;
        flight.block(Topic::DetectionParticles, bytes_of(&self.particles()))?;
        flight.block(Topic::Diagnosis, bytes_of(&self.diagnosis(graph, node)))?;
        flight.block(Topic::Action, bytes_of(&self.action(graph)))?;
        flight.block(Topic::Faults, bytes_of(&self.faults(graph, node)))?;
        for service in ServiceName::ALL {
            flight.block(Topic::Health(service), bytes_of(&self.health()))?;
        }
        Ok(())
    }
}

/// What services would have told.
fn timeline(graph: &Setup, node: usize) -> Timeline {
    let mut timeline = Timeline::new(graph);
    let event = |cycle: u64, kind: EventKind, what: u32| Event {
        t_ns: Instant::new(cycle).captured_ns(),
        kind: kind as u32,
        what,
        p: 0.99,
        value: 0,
    };
    timeline.add(ServiceName::SensorSim, &event(0, EventKind::Ready, 0));
    let alarm = event(ONSET + 2, EventKind::Alarm, 0);
    timeline.add(ServiceName::Detector, &alarm);
    let diagnosis = event(ONSET + 4, EventKind::Diagnosis, node as u32);
    timeline.add(ServiceName::Identifier, &diagnosis);
    timeline
}

fn main() -> Result<(), Box<dyn Error>> {
    let mut arguments = std::env::args().skip(1);
    let path = PathBuf::from(arguments.next().unwrap_or_else(|| "flight.mcap".to_owned()));
    let shipped = concat!(env!("CARGO_MANIFEST_DIR"), "/../../config/rover.toml");
    let graph_path = arguments.next().unwrap_or_else(|| shipped.to_owned());
    let document = Document::read(graph_path.as_ref(), |_| {})?;
    let graph = document.check()?;
    let node = graph.tree.leaves().next().ok_or("a tree without leaves")?;

    let mut flight = FlightWriter::create(&path, &graph, WallClock::ahead_by(AHEAD_NS))?;
    let why = BTreeMap::from([("reason".to_owned(), "an example".to_owned())]);
    flight.metadata("vigil", &why)?;
    let document = document.to_text()?;
    flight.attach("document.toml", "application/toml", document.as_bytes())?;
    for cycle in 0..CYCLES {
        Instant::new(cycle).write(&mut flight, &graph, node)?;
    }
    for entry in timeline(&graph, node).entries() {
        flight.event(&entry)?;
    }
    let summary = flight.finish()?;
    println!("{}: {} bytes", summary.path.display(), summary.bytes);
    for (topic, count) in &summary.messages {
        println!("{count:>6}  {topic}");
    }
    Ok(())
}
