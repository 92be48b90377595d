//! The graph in one thread under the virtual clock, written as a recording.

use std::path::{Path, PathBuf};

use rand::{RngExt, SeedableRng};
use rand_distr::StandardNormal;
use rand_pcg::Pcg64Mcg;
use vigil_blocks::{
    Action, CheckpointPart, Control, ControlCommand, DetectionBelief, FaultBelief, Faults, Journal,
    ParticleBlock, SensorFrame,
};
use vigil_cycle::placement::{PlacementRequest, read_back};
use vigil_cycle::port::{Bus, TopicBlock};
use vigil_cycle::topic::ServiceName;
use vigil_cycle::{
    CycleAccount, DeadlineMonitor, Graph, HealthBoard, KeptBlock, Receiver, Recorder, Sender,
    SourceCycle, Stage, StageCycle, Stamp, Topic, VirtualClock,
};
use vigil_detector::DetectorStage;
use vigil_flight::FlightWriter;
use vigil_identifier::IdentifierStage;
use vigil_sensor_sim::{SensorSource, SimulatorSource};
use vigil_setup::graph_file::GraphFile;
use vigil_setup::{Document, GraphArgs, Setup};
use vigil_supervisor::SupervisorStage;
use vigil_timeline::WallClock;

/// What is recorded, and how it runs.
pub struct Drive {
    /// Name of the configuration.
    pub config: &'static str,
    /// What of it is changed.
    pub change: fn(&mut GraphFile),
    /// Faults that are injected.
    pub inject: &'static [&'static str],
    /// Cycles of the graph.
    pub cycles: u64,
    /// Cycles before the recording begins.
    pub unrecorded: u64,
    /// What goes wrong in a cycle.
    pub hiccup: fn(u64) -> Hiccup,
}

/// A topic that is recorded.
struct Feed<T> {
    topic: Topic,
    receiver: Box<dyn Receiver<T>>,
}

impl<T: TopicBlock> Feed<T> {
    fn new(graph: &Graph, topic: Topic) -> Self {
        let receiver = graph.receiver(topic).unwrap();
        Self { topic, receiver }
    }

    /// Writes what has come; drops it without a file.
    fn drain(&mut self, flight: &mut Option<FlightWriter>) {
        while let Some(block) = self.receiver.take_next() {
            if let Some(flight) = flight {
                flight.block(self.topic, bytemuck::bytes_of(block)).unwrap();
            }
        }
    }
}

/// All that a replay needs.
struct Feeds {
    frames: Feed<SensorFrame>,
    detections: Feed<DetectionBelief>,
    particles: Feed<ParticleBlock>,
    diagnoses: Feed<FaultBelief>,
    actions: Feed<Action>,
    faults: Feed<Faults>,
    journals: [Feed<Journal>; 3],
    checkpoints: [Feed<CheckpointPart>; 3],
}

impl Feeds {
    fn new(graph: &Graph) -> Self {
        let services = ServiceName::STEPPING;
        Self {
            frames: Feed::new(graph, Topic::Sensor),
            detections: Feed::new(graph, Topic::Detection),
            particles: Feed::new(graph, Topic::DetectionParticles),
            diagnoses: Feed::new(graph, Topic::Diagnosis),
            actions: Feed::new(graph, Topic::Action),
            faults: Feed::new(graph, Topic::Faults),
            journals: services.map(|service| Feed::new(graph, Topic::Journal(service))),
            checkpoints: services.map(|service| Feed::new(graph, Topic::Checkpoint(service))),
        }
    }

    fn drain(&mut self, flight: &mut Option<FlightWriter>) {
        // Journals before what they are about, as it may happen in a recording.
        self.journals.iter_mut().for_each(|feed| feed.drain(flight));
        self.checkpoints
            .iter_mut()
            .for_each(|feed| feed.drain(flight));
        self.frames.drain(flight);
        self.detections.drain(flight);
        self.diagnoses.drain(flight);
        self.actions.drain(flight);
        self.faults.drain(flight);
        // Recordings have few of them, and a replay needs none.
        self.particles.drain(&mut None);
    }
}

/// Where frames come from.
enum Publisher {
    /// The simulated rover.
    Rover(Box<SourceCycle>, Box<SimulatorSource>),
    /// A Kobuki by its geometry, whose left wheel sticks.
    Kobuki(Box<dyn Sender<SensorFrame>>, u64, Pcg64Mcg),
}

/// From then on the Kobuki's left wheel stands, s.
const STUCK_S: f64 = 30.0;

impl Publisher {
    fn new(setup: &Setup, graph: &Graph, inject: &[&str]) -> Self {
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
        let cycle = SourceCycle::new(account(setup, graph, ServiceName::SensorSim), period_ns);
        Self::Rover(Box::new(cycle), Box::new(source.unwrap()))
    }

    /// Publishes a frame of another robot.
    fn spoil(&mut self, graph: &Graph, clock: &VirtualClock, t_ns: u64) {
        let mut frames = graph.sender::<SensorFrame>(Topic::Sensor).unwrap();
        frames.block().robot_hash = 1;
        let stamp = Stamp {
            t_schedule_ns: t_ns,
            t_capture_ns: t_ns,
        };
        frames.send(stamp, clock).unwrap();
    }

    /// Another start of the Kobuki's publisher.
    fn renew(&mut self, graph: &Graph) {
        if let Self::Kobuki(frames, ..) = self {
            *frames = graph.sender(Topic::Sensor).unwrap();
        }
    }

    fn turn(&mut self, clock: &VirtualClock, t_ns: u64) {
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
        let stands = wheel == 0 && t_s > STUCK_S;
        let speed = frame.command[0] + side * 0.115 * frame.command[1];
        let rate = if stands { 0.0 } else { speed / 0.035 };
        frame.set_channel(wheel, rate + noise(0.1));
        frame.set_channel(3 + wheel, 0.03 + noise(0.005));
    }
    let difference = frame.channel[1] - frame.channel[0];
    frame.set_channel(2, difference * 0.035 / 0.23 + noise(0.02));
}

fn stage(setup: &Setup, graph: &Graph, name: ServiceName) -> StageCycle {
    StageCycle::new(account(setup, graph, name))
}

fn account(setup: &Setup, graph: &Graph, name: ServiceName) -> CycleAccount {
    let schedule = setup
        .plan(name, vigil_cycle::serve::Leave::default())
        .schedule;
    let wanted = PlacementRequest {
        core: 0,
        priority: 1,
    };
    let sender = graph.sender(Topic::Health(name)).unwrap();
    let board = HealthBoard::new(sender, schedule, wanted, read_back(0));
    CycleAccount::new(
        DeadlineMonitor::new(schedule),
        board,
        Recorder::new().unwrap(),
    )
}

/// The configuration, as a file of its own.
fn document(drive: &Drive) -> Document {
    let root = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("..");
    let args = GraphArgs {
        config: root.join("config").join(drive.config),
        ..GraphArgs::default()
    };
    let mut document = args.read().unwrap();
    (drive.change)(&mut document.file);
    document
}

/// The services that step, each with its cycle.
struct Stages {
    cycles: [StageCycle; 3],
    detector: DetectorStage,
    identifier: IdentifierStage,
    supervisor: SupervisorStage,
}

impl Stages {
    fn new(setup: &Setup, graph: &Graph, kept: &Path, clock: &VirtualClock) -> Self {
        let step = vigil_identifier::assemble(setup).unwrap();
        let identifier = IdentifierStage::new(step, &setup.robot, graph).unwrap();
        let mut cycles = ServiceName::STEPPING.map(|name| stage(setup, graph, name));
        for cycle in &mut cycles {
            cycle.account_mut().ready(clock).unwrap();
        }
        Self {
            cycles,
            detector: detector(setup, graph),
            identifier,
            supervisor: supervisor(setup, graph, kept, clock),
        }
    }

    /// The detector is a new process.
    fn restart_detector(&mut self, setup: &Setup, graph: &Graph, clock: &VirtualClock) {
        self.detector = detector(setup, graph);
        self.cycles[0] = stage(setup, graph, ServiceName::Detector);
        self.cycles[0].account_mut().ready(clock).unwrap();
    }

    /// The supervisor is a new process.
    fn restart_supervisor(
        &mut self,
        setup: &Setup,
        graph: &Graph,
        kept: &Path,
        clock: &VirtualClock,
    ) {
        self.supervisor = supervisor(setup, graph, kept, clock);
        self.cycles[2] = stage(setup, graph, ServiceName::Supervisor);
        self.cycles[2].account_mut().ready(clock).unwrap();
    }

    fn turn(&mut self, k: u64, hiccup: Hiccup, clock: &VirtualClock) {
        let [first, second, third] = &mut self.cycles;
        if hiccup != Hiccup::DetectorLate {
            turn(first, &mut self.detector, clock);
        }
        if hiccup != Hiccup::IdentifierLate {
            turn(second, &mut self.identifier, clock);
        }
        if k % 997 == 5 {
            // As a cycle near its limit does.
            self.identifier.limit(20 + (k % 100) as u32);
        }
        turn(third, &mut self.supervisor, clock);
    }
}

fn detector(setup: &Setup, graph: &Graph) -> DetectorStage {
    let step = vigil_detector::assemble(setup).unwrap();
    DetectorStage::new(step, &setup.robot, graph).unwrap()
}

/// Keeps its faults in a file.
fn supervisor(setup: &Setup, graph: &Graph, kept: &Path, clock: &VirtualClock) -> SupervisorStage {
    let steps = vigil_supervisor::steps(setup).unwrap();
    let kept = KeptBlock::open(kept).unwrap();
    let validity_ns = vigil_supervisor::validity_ns(setup);
    SupervisorStage::new(steps, graph, validity_ns, Some(kept), clock).unwrap()
}

/// An operator orders something of all faults.
fn order(graph: &Graph, clock: &VirtualClock, command: ControlCommand, t_ns: u64) {
    let topic = Topic::Control(ServiceName::Supervisor);
    let mut orders = graph.sender::<Control>(topic).unwrap();
    orders.block().command = command as u32;
    let stamp = Stamp {
        t_schedule_ns: t_ns,
        t_capture_ns: t_ns,
    };
    orders.send(stamp, clock).unwrap();
}

/// Runs the graph, and writes what it publishes.
pub fn record(drive: &Drive, path: &Path) {
    let text = document(drive).to_text().unwrap();
    let setup = Document::from_text(path, text.clone()).unwrap();
    let setup = setup.check().unwrap();
    let (period_ns, clock) = (setup.period_ns(), VirtualClock::default());
    let graph = Graph::InProcess(Bus::new(clock.clone()));
    let mut feeds = Feeds::new(&graph);
    let mut publisher = Publisher::new(&setup, &graph, drive.inject);
    clock.set(period_ns);
    let kept = path.with_extension("faults");
    let mut stages = Stages::new(&setup, &graph, &kept, &clock);
    let mut flight = None;
    for k in 1..=drive.cycles {
        if k > drive.unrecorded && flight.is_none() {
            let mut file = FlightWriter::create(path, &setup, WallClock::now()).unwrap();
            file.attach("document.toml", "application/toml", text.as_bytes())
                .unwrap();
            flight = Some(file);
        }
        let t_ns = k * period_ns;
        clock.set(t_ns);
        let hiccup = (drive.hiccup)(k);
        match hiccup {
            // Later than every deadline of this period.
            Hiccup::Silent => clock.advance(period_ns - 1),
            Hiccup::Refused => publisher.spoil(&graph, &clock, t_ns),
            Hiccup::Renewed => publisher.renew(&graph),
            Hiccup::Restarted => stages.restart_detector(&setup, &graph, &clock),
            Hiccup::SupervisorRestarted => {
                stages.restart_supervisor(&setup, &graph, &kept, &clock);
            }
            Hiccup::Ordered(command) => order(&graph, &clock, command, t_ns),
            _ => {}
        }
        if !matches!(hiccup, Hiccup::Silent | Hiccup::Refused) {
            publisher.turn(&clock, t_ns);
        }
        stages.turn(k, hiccup, &clock);
        if k % 4 == 0 {
            feeds.drain(&mut flight);
        }
    }
    feeds.drain(&mut flight);
    flight.unwrap().finish().unwrap();
}

fn turn(cycle: &mut StageCycle, stage: &mut impl Stage, clock: &VirtualClock) {
    assert!(cycle.turn(stage, clock).unwrap().is_continue());
}

/// What goes wrong in a cycle.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Hiccup {
    Nothing,
    /// No frame comes.
    Silent,
    /// The detector folds this frame and the next.
    DetectorLate,
    /// The identifier folds this detection and the next.
    IdentifierLate,
    /// A frame comes that the border refuses.
    Refused,
    /// The publisher begins anew.
    Renewed,
    /// The detector is a new process.
    Restarted,
    /// The supervisor is a new process.
    SupervisorRestarted,
    /// An operator orders this of all faults.
    Ordered(ControlCommand),
}

/// What may happen at any time.
pub const fn now_and_then(k: u64) -> Hiccup {
    match k % 331 {
        77 | 230..=233 => Hiccup::Silent,
        120 | 121 => Hiccup::DetectorLate,
        160..=162 => Hiccup::IdentifierLate,
        190 => Hiccup::Refused,
        _ => Hiccup::Nothing,
    }
}
