//! The faults' life at its ports: frames, decisions and operators' orders in, the block out.

use vigil_blocks::{
    Action, Block, Control, ControlCommand, EventKind, FaultBelief, FaultRecord, Faults,
    SensorFrame,
};
use vigil_cycle::{
    Clock, Graph, HealthBoard, KeptBlock, PortError, Receiver, Sender, Stamp, Topic,
    topic::ServiceName,
};
use vigil_decision::{CycleDecision, FaultLife, LifeInput, LifeOrder};

/// Longest time between two blocks, ns: a reader takes the supervisor for gone after a few.
const INTERVAL_NS: u64 = 100_000_000;

/// Keeps the faults, publishes them, and has them ready for a supervisor that replaces this one.
pub struct FaultBoard {
    life: FaultLife,
    tree_hash: u64,
    frames: Box<dyn Receiver<SensorFrame>>,
    orders: Box<dyn Receiver<Control>>,
    faults: Box<dyn Sender<Faults>>,
    /// Where it is kept; nowhere in process.
    kept: Option<KeptBlock<Faults>>,
    /// Allocated once.
    block: Box<Faults>,
    diagnosis: Box<FaultBelief>,
    is_diagnosed: bool,
    decided: CycleDecision,
    published_ns: Option<u64>,
    revision_published: u64,
    /// Orders that are not answered yet.
    answers: Vec<OrderAnswer>,
}

/// What became of an order.
#[derive(Debug, Clone, Copy)]
struct OrderAnswer {
    epoch: u64,
    seq: u64,
    command: u32,
    is_done: bool,
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
        let mut block = Box::<Faults>::default();
        let left = kept.as_ref().and_then(KeptBlock::read);
        if let Some(left) = left.filter(|it| it.tree_hash == tree_hash) {
            life.restore(&left);
            *block = *left;
        }
        let orders: Box<dyn Receiver<Control>> =
            graph.receiver(Topic::Control(ServiceName::Supervisor))?;
        Ok(Self {
            life,
            tree_hash,
            frames: graph.receiver(Topic::Sensor)?,
            answers: Vec::with_capacity(orders.buffer()),
            orders,
            faults: graph.sender(Topic::Faults)?,
            kept,
            block,
            diagnosis: Box::default(),
            is_diagnosed: false,
            decided: CycleDecision::default(),
            published_ns: None,
            revision_published: 0,
        })
    }

    /// Keeps a diagnosis.
    pub(crate) fn take(&mut self, diagnosis: &FaultBelief) {
        *self.diagnosis = *diagnosis;
        self.is_diagnosed = true;
    }

    /// Keeps what was decided.
    pub(crate) fn decide(&mut self, action: &Action) {
        self.decided = action.into();
    }

    /// Lets the faults live for a cycle whose action has been published.
    pub(crate) fn turn(&mut self, clock: &dyn Clock) -> Result<(), PortError> {
        let now_ns = clock.now_ns();
        for _ in 0..self.frames.buffer() {
            let Some(frame) = self.frames.take_next() else {
                break;
            };
            if frame.header.schema == SensorFrame::SCHEMA {
                self.life.see(frame);
            }
        }
        self.life.step(LifeInput {
            now_ns,
            diagnosis: self.is_diagnosed.then_some(&*self.diagnosis),
            decided: self.decided,
        });
        self.obey(now_ns);
        self.publish(now_ns, clock)
    }

    /// Tells what has changed, and answers orders.
    pub(crate) fn report(&mut self, health: &mut HealthBoard, now_ns: u64) {
        for answer in self.answers.drain(..) {
            health.answer_control(answer.epoch, answer.seq, answer.is_done);
            if !answer.is_done {
                health.event(now_ns, EventKind::Refused, answer.command, 0.0, 0);
            }
        }
        while let Some(record) = self.life.take_change() {
            let (what, value) = event(record);
            health.event(now_ns, EventKind::Fault, what, record.p, value);
        }
    }

    /// Carries out what operators ask for.
    fn obey(&mut self, now_ns: u64) {
        for _ in 0..self.orders.buffer() {
            let Some(control) = self.orders.take_next().copied() else {
                break;
            };
            let order = order(&control).filter(|_| control.header.schema == Control::SCHEMA);
            let is_done = order.is_some_and(|order| self.life.obey(order, now_ns));
            let (epoch, seq) = (control.header.epoch, control.header.seq);
            if is_done {
                (self.block.order_epoch, self.block.order_seq) = (epoch, seq);
            }
            let command = control.command;
            if self.answers.len() < self.answers.capacity() {
                self.answers.push(OrderAnswer {
                    epoch,
                    seq,
                    command,
                    is_done,
                });
            }
        }
    }

    fn publish(&mut self, now_ns: u64, clock: &dyn Clock) -> Result<(), PortError> {
        let is_changed = self.life.revision() != self.revision_published;
        let passed_ns = self.published_ns.map(|at_ns| now_ns.saturating_sub(at_ns));
        if !is_changed && passed_ns.is_some_and(|passed_ns| passed_ns < INTERVAL_NS) {
            return Ok(());
        }
        self.life.write(&mut self.block, self.tree_hash);
        if let Some(kept) = self.kept.as_mut().filter(|_| is_changed) {
            kept.write(&self.block);
        }
        *self.faults.block() = *self.block;
        let stamp = Stamp {
            t_schedule_ns: now_ns,
            t_capture_ns: now_ns,
        };
        self.faults.send(stamp, clock)?;
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
