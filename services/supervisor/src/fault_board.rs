//! The faults' life at its ports: frames, decisions and operators' orders in, the block out.

use vigil_blocks::{
    Block, BlockId, Carryover, Control, EventKind, FaultRecord, Faults, Health, JournalEntry,
    JournalKind, SensorFrame,
};
use vigil_cycle::health::HEALTH_PERIOD_NS;
use vigil_cycle::{
    Clock, Graph, HealthBoard, JournalWriter, KeptBlock, PortError, Receiver, Sender, Stamp, Topic,
    topic::ServiceName,
};

use crate::steps::{FaultStep, Steps};

/// Longest time between two blocks, ns: a reader takes the supervisor for gone after a few.
const INTERVAL_NS: u64 = 100_000_000;
/// A service whose Health is older than this is silent, ns: five of its intervals.
const SILENCE_NS: u64 = 5 * HEALTH_PERIOD_NS;

/// The ports of the faults' life. It keeps the faults for a supervisor that replaces this one.
pub struct FaultBoard {
    frames: Box<dyn Receiver<SensorFrame>>,
    orders: Box<dyn Receiver<Control>>,
    peers: [PeerHealth; 3],
    faults: Box<dyn Sender<Faults>>,
    /// Where they are kept; nowhere in process.
    kept: Option<KeptBlock<Faults>>,
    published_ns: Option<u64>,
    revision_published: u64,
    /// As it was kept last.
    carryover: Carryover,
    /// Why they could not be published, until the stage can say so.
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
    /// Opens the ports on `graph`. What another has left in `kept` goes on in `steps`; it is
    /// published again, and noted in the `journal`.
    ///
    /// # Errors
    /// The transport's.
    pub fn new(
        steps: &mut Steps,
        journal: &mut JournalWriter,
        graph: &Graph,
        kept: Option<KeptBlock<Faults>>,
        clock: &dyn Clock,
    ) -> Result<Self, PortError> {
        use ServiceName::{Detector, Identifier, SensorSim, Supervisor};
        let peer = |service| PeerHealth::new(service, graph);
        let left = kept.as_ref().and_then(KeptBlock::read);
        let is_restored = left.is_some_and(|left| steps.restore(&left));
        let mut board = Self {
            frames: graph.receiver(Topic::Sensor)?,
            orders: graph.receiver(Topic::Control(Supervisor))?,
            peers: [peer(SensorSim)?, peer(Detector)?, peer(Identifier)?],
            faults: graph.sender(Topic::Faults)?,
            kept,
            failed: None,
            published_ns: None,
            revision_published: 0,
            carryover: Carryover::default(),
        };
        if is_restored {
            let left = board.send(steps, clock.now_ns())?;
            journal.note(JournalEntry::new(JournalKind::Restored, 1).with_input(left));
        }
        Ok(board)
    }

    /// Lets the faults live for a turn, whatever it was, and tells what has changed. What fails is
    /// told by [`Self::failure`].
    pub(crate) fn turn(
        &mut self,
        steps: &mut Steps,
        journal: &mut JournalWriter,
        health: &mut HealthBoard,
        now_ns: u64,
    ) {
        let step = &mut steps.faults;
        for _ in 0..self.frames.buffer() {
            let Some(frame) = self.frames.take_next() else {
                break;
            };
            // Without an epoch it could not be named.
            if frame.header.schema == SensorFrame::SCHEMA && frame.header.epoch != 0 {
                let entry = JournalEntry::new(JournalKind::Kept, 1);
                journal.note(entry.with_input(frame.header.id()));
                step.keep(frame);
            }
        }
        let silent = self.peers.iter_mut().map(|peer| peer.silent(now_ns));
        let silent_services = silent.fold(0, |all, bit| all | bit);
        journal.note(JournalEntry::new(JournalKind::Lived, silent_services).at(now_ns));
        step.live(now_ns, silent_services);
        self.obey(step, journal, health, now_ns);
        while let Some(record) = step.take_change() {
            let (what, value) = event(record);
            health.event(now_ns, EventKind::Fault, what, record.p, value);
        }
        self.failed = self.publish(steps, journal, now_ns).err();
    }

    /// Why the last block could not be published, once.
    pub(crate) const fn failure(&mut self) -> Option<PortError> {
        self.failed.take()
    }

    /// Carries out what operators ask for.
    fn obey(
        &mut self,
        step: &mut FaultStep,
        journal: &mut JournalWriter,
        health: &mut HealthBoard,
        now_ns: u64,
    ) {
        for _ in 0..self.orders.buffer() {
            let Some(control) = self.orders.take_next() else {
                break;
            };
            let (id, command, fault) = (control.header.id(), control.command, control.fault);
            let is_ours = control.header.schema == Control::SCHEMA;
            let is_done = is_ours && step.obey(command, fault, now_ns);
            if is_ours {
                // The entry says it all: the sender may be gone before a recording sees the block.
                let entry = JournalEntry::new(JournalKind::Ordered, command).about(fault);
                journal.note(entry.with_input(id).at(now_ns));
            }
            health.answer_control(id.epoch, id.seq, is_done);
            if !is_done {
                health.event(now_ns, EventKind::Refused, command, 0.0, 0);
            }
        }
    }

    fn publish(
        &mut self,
        steps: &Steps,
        journal: &mut JournalWriter,
        now_ns: u64,
    ) -> Result<(), PortError> {
        let is_changed = self.is_changed(steps);
        let passed_ns = self.published_ns.map(|at_ns| now_ns.saturating_sub(at_ns));
        if !is_changed && passed_ns.is_some_and(|passed_ns| passed_ns < INTERVAL_NS) {
            return Ok(());
        }
        let id = self.send(steps, now_ns)?;
        journal.note(JournalEntry::new(JournalKind::Told, 1).with_input(id));
        Ok(())
    }

    /// Publishes the faults, and keeps them if they are others than before.
    fn send(&mut self, steps: &Steps, now_ns: u64) -> Result<BlockId, PortError> {
        let (epoch, seq) = (self.faults.epoch(), self.faults.next_seq());
        let is_changed = self.is_changed(steps);
        let block = self.faults.block();
        steps.write(block);
        if is_changed {
            self.carryover = block.carryover;
            if let Some(kept) = &mut self.kept {
                kept.write(block);
            }
        }
        let stamp = Stamp {
            t_schedule_ns: now_ns,
            t_capture_ns: now_ns,
        };
        self.faults.send(stamp, &Instant(now_ns))?;
        self.published_ns = Some(now_ns);
        self.revision_published = steps.faults.revision();
        Ok(BlockId { epoch, seq })
    }

    /// True if the next supervisor would not go on from the same.
    fn is_changed(&self, steps: &Steps) -> bool {
        let carryover = steps.supervisor.carryover();
        steps.faults.revision() != self.revision_published
            || carryover.differs_from(&self.carryover)
    }
}

/// `what` and `value` of an event about a fault.
const fn event(record: &FaultRecord) -> (u32, u64) {
    let what = record.what & 0xffff | record.source << 16;
    (what, record.state as u64 & 0xff | record.number << 8)
}
