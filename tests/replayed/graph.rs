//! The graph in one thread under the virtual clock, written as a recording.

use std::path::Path;

use vigil_blocks::{
    Action, CheckpointPart, Control, ControlCommand, DetectionBelief, FaultBelief, Faults, Journal,
    ParticleBlock, SensorFrame,
};
use vigil_cycle::port::{Bus, TopicBlock};
use vigil_cycle::topic::ServiceName;
use vigil_cycle::{Graph, Receiver, Stamp, Topic, VirtualClock};
use vigil_flight::FlightWriter;
use vigil_setup::Document;
use vigil_setup::graph_file::GraphFile;
use vigil_timeline::WallClock;

use crate::virtual_graph::{Publisher, Stages, VirtualGraph, document};

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

/// One turn of all services.
fn turn(stages: &mut Stages<'_>, k: u64, hiccup: Hiccup) {
    if hiccup != Hiccup::DetectorLate {
        stages.turn(ServiceName::Detector);
    }
    if hiccup != Hiccup::IdentifierLate {
        stages.turn(ServiceName::Identifier);
    }
    if k % 997 == 5 {
        // As a cycle near its limit does.
        stages.limit(20 + (k % 100) as u32);
    }
    stages.turn(ServiceName::Supervisor);
}

/// Runs the graph, and writes what it publishes.
pub fn record(drive: &Drive, path: &Path) {
    let text = document(drive.config, drive.change).to_text().unwrap();
    let setup = Document::from_text(path, text.clone()).unwrap();
    let setup = setup.check().unwrap();
    let (period_ns, clock) = (setup.period_ns(), VirtualClock::default());
    let graph = Graph::InProcess(Bus::new(clock.clone()));
    let mut feeds = Feeds::new(&graph);
    let mut publisher = Publisher::new(&setup, &graph, drive.inject);
    clock.set(period_ns);
    let kept = path.with_extension("faults");
    let mut stages = Stages::new(VirtualGraph {
        setup: &setup,
        graph: &graph,
        clock: &clock,
        kept: &kept,
    });
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
            Hiccup::Restarted => stages.start(ServiceName::Detector),
            Hiccup::SupervisorRestarted => stages.start(ServiceName::Supervisor),
            Hiccup::Ordered(command) => order(&graph, &clock, command, t_ns),
            _ => {}
        }
        if !matches!(hiccup, Hiccup::Silent | Hiccup::Refused) {
            publisher.turn(&clock, t_ns);
        }
        turn(&mut stages, k, hiccup);
        if k % 4 == 0 {
            feeds.drain(&mut flight);
        }
    }
    feeds.drain(&mut flight);
    flight.unwrap().finish().unwrap();
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
