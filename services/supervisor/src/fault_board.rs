//! The faults' life at its ports: frames, decisions and operators' orders in, the block out.

use vigil_blocks::{
    Action, Block, Control, ControlCommand, EventKind, FaultBelief, FaultRecord, Faults, Health,
    Readiness, SensorFrame,
};
use vigil_cycle::health::HEALTH_PERIOD_NS;
use vigil_cycle::{
    Clock, Graph, HealthBoard, KeptBlock, PortError, Receiver, Sender, Stamp, Topic,
    topic::ServiceName,
};
use vigil_decision::{CycleDecision, FaultLife, LifeInput, LifeOrder};

/// Longest time between two blocks, ns: a reader takes the supervisor for gone after a few.
const INTERVAL_NS: u64 = 100_000_000;
/// A service whose Health is older than this is silent, ns: five of its intervals.
const SILENCE_NS: u64 = 5 * HEALTH_PERIOD_NS;

/// Keeps the faults, publishes them, and has them ready for a supervisor that replaces this one.
pub struct FaultBoard {
    life: FaultLife,
    tree_hash: u64,
    frames: Box<dyn Receiver<SensorFrame>>,
    orders: Box<dyn Receiver<Control>>,
    peers: [PeerHealth; 3],
    faults: Box<dyn Sender<Faults>>,
    /// Where it is kept; nowhere in process.
    kept: Option<KeptBlock<Faults>>,
    /// Allocated once.
    diagnosis: Box<FaultBelief>,
    is_diagnosed: bool,
    /// A diagnosis of this turn says something of the robot.
    observes: bool,
    decided: CycleDecision,
    published_ns: Option<u64>,
    revision_published: u64,
    /// Why it could not be published, until the stage can say so.
    failed: Option<PortError>,
}

/// When another service was heard last.
struct PeerHealth {
    service: ServiceName,
    health: Box<dyn Receiver<Health>>,
    heard_ns: Option<u64>,
}

impl PeerHealth {
    fn new(service: ServiceName, graph: &Graph) -> Result<Self, PortError> {
        Ok(Self {
            service,
            health: graph.receiver(Topic::Health(service))?,
            heard_ns: None,
        })
    }

    /// Its bit if it was heard once, and is silent now.
    fn silent(&mut self, now_ns: u64) -> u32 {
        for _ in 0..self.health.buffer() {
            let Some(health) = self.health.take_next() else {
                break;
            };
            self.heard_ns = Some(health.header.t_publish_ns);
        }
        let age_ns = self.heard_ns.map(|at_ns| now_ns.saturating_sub(at_ns));
        u32::from(age_ns.is_some_and(|age_ns| age_ns > SILENCE_NS)) << self.service.index()
    }
}

/// An instant as a clock, for the stamp of what is sent then.
struct Instant(u64);

impl Clock for Instant {
    fn now_ns(&self) -> u64 {
        self.0
    }
}

impl FaultBoard {
    /// Opens the ports on `graph`. What another has kept in `kept` goes on.
    ///
    /// # Errors
    /// The transport's.
    pub fn new(
        mut life: FaultLife,
        tree_hash: u64,
        graph: &Graph,
        kept: Option<KeptBlock<Faults>>,
    ) -> Result<Self, PortError> {
        let left = kept.as_ref().and_then(KeptBlock::read);
        if let Some(left) = left.filter(|it| it.tree_hash == tree_hash) {
            life.restore(&left);
        }
        use ServiceName::{Detector, Identifier, SensorSim, Supervisor};
        let peer = |service| PeerHealth::new(service, graph);
        Ok(Self {
            life,
            tree_hash,
            frames: graph.receiver(Topic::Sensor)?,
            orders: graph.receiver(Topic::Control(Supervisor))?,
            peers: [peer(SensorSim)?, peer(Detector)?, peer(Identifier)?],
            faults: graph.sender(Topic::Faults)?,
            kept,
            diagnosis: Box::default(),
            is_diagnosed: false,
            observes: false,
            failed: None,
            decided: CycleDecision::default(),
            published_ns: None,
            revision_published: 0,
        })
    }

    /// Keeps a diagnosis, by a detector that says whether an alarm could rise. One of another fault
    /// tree is none.
    pub(crate) fn take(&mut self, diagnosis: &FaultBelief, readiness: u32) {
        if diagnosis.tree_hash == self.tree_hash {
            *self.diagnosis = *diagnosis;
            self.is_diagnosed = true;
            self.observes = readiness == Readiness::Armed as u32;
        }
    }

    /// Keeps what was decided.
    pub(crate) fn decide(&mut self, action: &Action) {
        self.decided = action.into();
    }

    /// Lets the faults live for a turn, whatever it was, and tells what has changed. What fails is
    /// told by [`Self::failure`].
    pub(crate) fn turn(&mut self, health: &mut HealthBoard, now_ns: u64) {
        for _ in 0..self.frames.buffer() {
            let Some(frame) = self.frames.take_next() else {
                break;
            };
            if frame.header.schema == SensorFrame::SCHEMA {
                self.life.see(frame);
            }
        }
        let silent = self.peers.iter_mut().map(|peer| peer.silent(now_ns));
        let silent_services = silent.fold(0, |all, bit| all | bit);
        self.life.step(LifeInput {
            now_ns,
            diagnosis: self.is_diagnosed.then_some(&*self.diagnosis),
            decided: self.decided,
            observes: std::mem::take(&mut self.observes) && self.decided.blind == 0,
            silent_services,
        });
        self.obey(health, now_ns);
        while let Some(record) = self.life.take_change() {
            let (what, value) = event(record);
            health.event(now_ns, EventKind::Fault, what, record.p, value);
        }
        self.failed = self.publish(now_ns).err();
    }

    /// Why the last block could not be published, once.
    pub(crate) const fn failure(&mut self) -> Option<PortError> {
        self.failed.take()
    }

    /// Carries out what operators ask for.
    fn obey(&mut self, health: &mut HealthBoard, now_ns: u64) {
        for _ in 0..self.orders.buffer() {
            let Some(control) = self.orders.take_next().copied() else {
                break;
            };
            let order = order(&control).filter(|_| control.header.schema == Control::SCHEMA);
            let is_done = order.is_some_and(|order| self.life.obey(order, now_ns));
            health.answer_control(control.header.epoch, control.header.seq, is_done);
            if !is_done {
                health.event(now_ns, EventKind::Refused, control.command, 0.0, 0);
            }
        }
    }

    fn publish(&mut self, now_ns: u64) -> Result<(), PortError> {
        let is_changed = self.life.revision() != self.revision_published;
        let passed_ns = self.published_ns.map(|at_ns| now_ns.saturating_sub(at_ns));
        if !is_changed && passed_ns.is_some_and(|passed_ns| passed_ns < INTERVAL_NS) {
            return Ok(());
        }
        let block = self.faults.block();
        self.life.write(block, self.tree_hash);
        if let Some(kept) = self.kept.as_mut().filter(|_| is_changed) {
            kept.write(block);
        }
        let stamp = Stamp {
            t_schedule_ns: now_ns,
            t_capture_ns: now_ns,
        };
        self.faults.send(stamp, &Instant(now_ns))?;
        (self.published_ns, self.revision_published) = (Some(now_ns), self.life.revision());
        Ok(())
    }
}

/// What an operator asks for, if it is for the supervisor.
fn order(control: &Control) -> Option<LifeOrder> {
    let is = |command: ControlCommand| control.command == command as u32;
    let acknowledge = LifeOrder::Acknowledge(u64::from(control.fault));
    match () {
        () if is(ControlCommand::Acknowledge) => Some(acknowledge),
        () if is(ControlCommand::Forget) => Some(LifeOrder::Clear),
        () => None,
    }
}

/// `what` and `value` of an event about a fault.
const fn event(record: &FaultRecord) -> (u32, u64) {
    let what = record.what & 0xffff | record.source << 16;
    (what, record.state as u64 & 0xff | record.number << 8)
}
