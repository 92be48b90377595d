//! The graph in one thread under the virtual clock, whose services may be dead for a while.
#![allow(dead_code)]

pub mod kobuki;
mod publisher;

use std::path::{Path, PathBuf};

use vigil_cycle::placement::{PlacementRequest, read_back};
use vigil_cycle::topic::ServiceName;
use vigil_cycle::{
    CycleAccount, DeadlineMonitor, Graph, HealthBoard, KeptBlock, Recorder, Stage, StageCycle,
    Topic, VirtualClock,
};
use vigil_detector::DetectorStage;
use vigil_identifier::IdentifierStage;
use vigil_setup::graph_file::GraphFile;
use vigil_setup::{Document, Setup};
use vigil_supervisor::SupervisorStage;

pub use publisher::Publisher;

/// The configuration of this name with a change, as a file of its own.
pub fn document(config: &str, change: impl FnOnce(&mut GraphFile)) -> Document {
    let folder = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../config");
    Document::read(&folder.join(config), change).unwrap()
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

/// A service that steps, with its cycle.
struct Service<S> {
    cycle: StageCycle,
    stage: S,
}

impl<S: Stage> Service<S> {
    fn new(graph: &VirtualGraph<'_>, name: ServiceName, stage: S) -> Self {
        let mut cycle = StageCycle::new(account(graph.setup, graph.graph, name));
        cycle.account_mut().ready(graph.clock).unwrap();
        Self { cycle, stage }
    }

    fn turn(&mut self, clock: &VirtualClock) {
        let result = self.cycle.turn(&mut self.stage, clock).unwrap();
        assert!(result.is_continue());
    }
}

/// Where services run.
#[derive(Clone, Copy)]
pub struct VirtualGraph<'a> {
    pub setup: &'a Setup,
    pub graph: &'a Graph,
    pub clock: &'a VirtualClock,
    /// File in which the supervisor keeps its faults.
    pub kept: &'a Path,
}

/// The services that step; one that is dead is none.
pub struct Stages<'a> {
    graph: VirtualGraph<'a>,
    detector: Option<Service<DetectorStage>>,
    identifier: Option<Service<IdentifierStage>>,
    supervisor: Option<Service<SupervisorStage>>,
}

impl<'a> Stages<'a> {
    pub fn new(graph: VirtualGraph<'a>) -> Self {
        let mut stages = Self {
            graph,
            detector: None,
            identifier: None,
            supervisor: None,
        };
        for name in ServiceName::STEPPING {
            stages.start(name);
        }
        stages
    }

    /// A new process of a service takes its place.
    pub fn start(&mut self, name: ServiceName) {
        let VirtualGraph { setup, graph, .. } = self.graph;
        self.end(name);
        match name {
            ServiceName::Detector => {
                let step = vigil_detector::assemble(setup).unwrap();
                let stage = DetectorStage::new(step, &setup.robot, graph).unwrap();
                self.detector = Some(Service::new(&self.graph, name, stage));
            }
            ServiceName::Identifier => {
                let step = vigil_identifier::assemble(setup).unwrap();
                let stage = IdentifierStage::new(step, &setup.robot, graph).unwrap();
                self.identifier = Some(Service::new(&self.graph, name, stage));
            }
            ServiceName::Supervisor => {
                let stage = self.graph.supervisor();
                self.supervisor = Some(Service::new(&self.graph, name, stage));
            }
            ServiceName::SensorSim => unreachable!("it does not step"),
        }
    }

    /// A service is dead from now on.
    pub fn end(&mut self, name: ServiceName) {
        match name {
            ServiceName::Detector => self.detector = None,
            ServiceName::Identifier => self.identifier = None,
            ServiceName::Supervisor => self.supervisor = None,
            ServiceName::SensorSim => unreachable!("it does not step"),
        }
    }

    /// One turn of a service, if it lives.
    pub fn turn(&mut self, name: ServiceName) {
        let clock = self.graph.clock;
        match name {
            ServiceName::Detector => self.detector.iter_mut().for_each(|it| it.turn(clock)),
            ServiceName::Identifier => self.identifier.iter_mut().for_each(|it| it.turn(clock)),
            ServiceName::Supervisor => self.supervisor.iter_mut().for_each(|it| it.turn(clock)),
            ServiceName::SensorSim => unreachable!("it does not step"),
        }
    }

    /// The identifier works with at most so many hypotheses.
    pub fn limit(&mut self, count: u32) {
        if let Some(identifier) = &mut self.identifier {
            identifier.stage.limit(count);
        }
    }
}

impl VirtualGraph<'_> {
    fn supervisor(&self) -> SupervisorStage {
        let steps = vigil_supervisor::steps(self.setup).unwrap();
        let kept = KeptBlock::open(self.kept).unwrap();
        let validity_ns = vigil_supervisor::validity_ns(self.setup);
        SupervisorStage::new(steps, self.graph, validity_ns, Some(kept), self.clock).unwrap()
    }
}
