//! What the supervisor computes: actions, and the life of faults.

use vigil_blocks::{
    Action, ControlCommand, Entry, FaultBelief, FaultRecord, Faults, Readiness, SensorFrame,
};
use vigil_checkpoint::Checkpoint;
use vigil_decision::{CycleDecision, FaultLife, Inputs, LifeInput, LifeOrder, Supervisor};

/// All that the supervisor computes: its state is the service's.
#[derive(Checkpoint)]
pub struct Steps {
    /// What decides.
    pub supervisor: Supervisor,
    /// What keeps the faults.
    pub faults: FaultStep,
}

impl Steps {
    /// Takes a diagnosis, a detection or both, and writes the decision.
    pub fn take(&mut self, inputs: Inputs<'_>, action: &mut Action) {
        self.supervisor.step(Entry::Frame(inputs), action);
        self.faults.take(inputs, self.supervisor.hears_identifier());
    }

    /// Goes on from what an earlier supervisor has left; false if that is of another fault tree.
    pub fn restore(&mut self, left: &Faults) -> bool {
        let is_ours = self.faults.restore(left);
        if is_ours {
            let believed = self.faults.diagnosis();
            self.supervisor
                .restore(&left.carryover, believed.as_deref());
        }
        is_ours
    }

    /// Writes everything but the header.
    pub fn write(&self, block: &mut Faults) {
        self.faults.write(block);
        block.carryover = self.supervisor.carryover();
    }
}

/// The life of faults, fed with what the supervisor takes in a turn.
#[derive(Checkpoint)]
pub struct FaultStep {
    life: FaultLife,
    #[checkpoint(fixed)]
    tree_hash: u64,
    /// What the last detection said of whether an alarm could rise.
    readiness: u32,
    decided: CycleDecision,
    /// The diagnosis of this turn, if it says something of the robot. Allocated once.
    #[checkpoint(scratch)]
    diagnosis: Box<FaultBelief>,
    observes: bool,
}

impl FaultStep {
    /// Of the fault tree with this hash.
    #[must_use]
    pub fn new(life: FaultLife, tree_hash: u64) -> Self {
        Self {
            life,
            tree_hash,
            readiness: 0,
            decided: CycleDecision::default(),
            diagnosis: Box::default(),
            observes: false,
        }
    }

    fn restore(&mut self, left: &Faults) -> bool {
        let is_ours = left.tree_hash == self.tree_hash;
        if is_ours {
            self.life.restore(left);
        }
        is_ours
    }

    /// See [`FaultLife::diagnosis`].
    fn diagnosis(&self) -> Option<Box<FaultBelief>> {
        self.life.diagnosis(self.tree_hash)
    }

    /// Keeps a frame, for what is measured when a fault begins.
    pub fn keep(&mut self, frame: &SensorFrame) {
        self.life.see(frame);
    }

    /// Takes what the supervisor takes. A diagnosis of another fault tree is none, nor is that of
    /// an identifier which is not heard.
    fn take(&mut self, inputs: Inputs<'_>, is_heard: bool) {
        if let Some(detection) = inputs.detection {
            self.readiness = detection.readiness;
        }
        let ours = |it: &&FaultBelief| is_heard && it.tree_hash == self.tree_hash;
        if let Some(diagnosis) = inputs.diagnosis.filter(ours) {
            *self.diagnosis = *diagnosis;
            self.observes = self.readiness == Readiness::Armed as u32;
        }
    }

    /// Takes what was decided.
    pub fn decide(&mut self, action: &Action) {
        self.decided = action.into();
    }

    /// Lets the faults live until `now_ns` of `CLOCK_MONOTONIC`; these services are silent, as bits
    /// in the order of the data.
    pub fn live(&mut self, now_ns: u64, silent_services: u32) {
        let observes = std::mem::take(&mut self.observes) && self.decided.blind == 0;
        self.life.step(LifeInput {
            now_ns,
            observed: observes.then_some(&*self.diagnosis),
            decided: self.decided,
            silent_services,
        });
    }

    /// Carries out an operator's order, a [`ControlCommand`] and the number of a fault; false if it
    /// is none about faults, or finds nothing to do.
    pub fn obey(&mut self, command: u32, fault: u32, now_ns: u64) -> bool {
        let is = |wanted: ControlCommand| command == wanted as u32;
        let order = match () {
            () if is(ControlCommand::Acknowledge) => LifeOrder::Acknowledge(u64::from(fault)),
            () if is(ControlCommand::Forget) => LifeOrder::Clear,
            () => return false,
        };
        self.life.obey(order, now_ns)
    }

    /// See [`FaultLife::take_change`].
    pub fn take_change(&mut self) -> Option<&FaultRecord> {
        self.life.take_change()
    }

    /// See [`FaultLife::revision`].
    #[must_use]
    pub const fn revision(&self) -> u64 {
        self.life.revision()
    }

    fn write(&self, block: &mut Faults) {
        self.life.write(block, self.tree_hash);
    }
}
