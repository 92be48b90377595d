//! The supervisor at its ports.

use vigil_blocks::{
    Action, AnsweredWheels, Cause, CauseKind, ControlMode, DetectionBelief, Entry, EventKind,
    FaultBelief, Faults, JournalEntry, JournalKind, Weighing,
};
use vigil_cycle::topic::ServiceName;
use vigil_cycle::{
    Clock, Graph, HealthBoard, InputAccount, Intake, JournalWriter, KeptBlock, PortError, Receiver,
    Sender, Stage, Stamp, Topic,
};

use vigil_decision::Inputs;

use crate::fault_board::FaultBoard;
use crate::steps::Steps;

/// The supervisor as a stage of the graph: diagnoses and detections in, actions out.
pub struct SupervisorStage {
    steps: Steps,
    diagnoses: Box<dyn Receiver<FaultBelief>>,
    detections: Box<dyn Receiver<DetectionBelief>>,
    detection_account: InputAccount,
    detection: Box<DetectionBelief>,
    detection_is_new: bool,
    validity_ns: u64,
    action: Box<dyn Sender<Action>>,
    decided: LastDecision,
    step: ModelStep,
    /// Steps that the timeline has.
    steps_reported: u64,
    /// Number of the decision that the timeline has.
    decision_reported: u64,
    alarm: AlarmCount,
    /// What the timeline has of `alarm`.
    alarm_reported: AlarmCount,
    board: FaultBoard,
    latched_reported: Option<usize>,
    journal: JournalWriter,
}

/// Whether the fused alarm stands, and how many there were.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
struct AlarmCount {
    stands: bool,
    count: u32,
}

/// The decision model's last step.
#[derive(Debug, Clone, Copy, Default)]
struct ModelStep {
    belief: u64,
    count: u64,
    action: u32,
    observation: u32,
}

/// What the last block decided, for the timeline.
#[derive(Debug, Clone, Copy, Default)]
struct LastDecision {
    seq: u64,
    action: u32,
    wheels: AnsweredWheels,
    p: f64,
    weighing: Option<Weighing>,
}

impl SupervisorStage {
    /// Opens the supervisor's ports on `graph`. Each action is valid for `validity_ns` after its
    /// publication. Faults are kept in `kept`, from which those of an earlier supervisor go on.
    ///
    /// # Errors
    /// The transport's.
    pub fn new(
        mut steps: Steps,
        graph: &Graph,
        validity_ns: u64,
        kept: Option<KeptBlock<Faults>>,
        clock: &dyn Clock,
    ) -> Result<Self, PortError> {
        let mut journal = JournalWriter::open(graph, ServiceName::Supervisor)?;
        let board = FaultBoard::new(&mut steps, &mut journal, graph, kept, clock)?;
        // What another has told is not told again.
        let left = steps.supervisor.carryover();
        let alarm = AlarmCount {
            stands: left.alarm_t_capture_ns != 0,
            count: left.alarm_count,
        };
        Ok(Self {
            latched_reported: steps.supervisor.latched(),
            steps,
            diagnoses: graph.receiver(Topic::Diagnosis)?,
            detections: graph.receiver(Topic::Detection)?,
            detection_account: InputAccount::default(),
            detection: Box::default(),
            detection_is_new: false,
            validity_ns,
            action: graph.sender(Topic::Action)?,
            decided: LastDecision::default(),
            step: ModelStep::default(),
            steps_reported: 0,
            decision_reported: 0,
            alarm,
            alarm_reported: alarm,
            board,
            journal,
        })
    }

    fn take_detections(&mut self, intake: &Intake<'_>) {
        for _ in 0..self.detections.buffer() {
            let Some(block) = self.detections.take_next() else {
                break;
            };
            let account = &mut self.detection_account;
            let is_taken =
                intake.admit_further::<DetectionBelief>(account, &block.header, || Ok(()));
            if !is_taken {
                continue;
            }
            // A prediction does not replace the belief about a frame, but for whether it is blind.
            if self.detection_is_new && block.cause.kind() != Some(CauseKind::Frame) {
                self.detection.blind = block.blind;
            } else {
                *self.detection = *block;
                self.detection_is_new = true;
            }
        }
    }

    /// Puts each step of the model, each fused alarm and each latched action into the timeline.
    fn report(&mut self, health: &mut HealthBoard, now_ns: u64) {
        let ModelStep {
            belief,
            count,
            action,
            observation,
        } = self.step;
        if count != self.steps_reported {
            let value = u64::from(observation) | belief << 32;
            health.event(now_ns, EventKind::Step, action, count as f64, value);
            self.steps_reported = count;
        }
        let AlarmCount { stands, count } = self.alarm;
        if self.alarm != self.alarm_reported {
            let kind = match stands {
                true => EventKind::Alarm,
                false => EventKind::Cleared,
            };
            if stands || self.alarm_reported.stands {
                health.event(now_ns, kind, 0, self.detection.p_fault, u64::from(count));
            }
            self.alarm_reported = self.alarm;
        }
        let latched = self.steps.supervisor.latched();
        if latched != self.latched_reported {
            let kind = match latched {
                Some(_) => EventKind::Latched,
                None => EventKind::Released,
            };
            if let Some(action) = latched.or(self.latched_reported) {
                health.event(now_ns, kind, action as u32, 0.0, 0);
            }
            self.latched_reported = latched;
        }
    }
}

/// What the step takes, by name.
fn journal_entry(inputs: Inputs<'_>) -> JournalEntry {
    let mut entry = JournalEntry::new(JournalKind::Frame, 1);
    if let Some(diagnosis) = inputs.diagnosis {
        entry = entry.with_input(diagnosis.header.id());
    }
    if let Some(detection) = inputs.detection {
        entry = entry.with_detection(detection.header.id(), detection.blind);
    }
    entry
}

impl Stage for SupervisorStage {
    fn take(&mut self, intake: &mut Intake<'_>) {
        self.take_detections(intake);
        for _ in 0..self.diagnoses.buffer() {
            let Some(diagnosis) = self.diagnoses.take_next() else {
                break;
            };
            let (header, cause) = (&diagnosis.header, &diagnosis.cause);
            if intake.accept::<FaultBelief>(header) && cause.kind() == Some(CauseKind::Frame) {
                let detection = self.detection_is_new.then_some(&*self.detection);
                let inputs = Inputs {
                    diagnosis: Some(diagnosis),
                    detection,
                };
                self.journal.note(journal_entry(inputs));
                self.steps.take(inputs, self.action.block());
                self.detection_is_new = false;
                intake.stepped(header, cause.frame());
            }
        }
    }

    fn miss(&mut self, count: u32) {
        let supervisor = &mut self.steps.supervisor;
        supervisor.step(Entry::Missed(count), self.action.block());
        self.journal
            .note(JournalEntry::new(JournalKind::Missed, count));
        if self.detection_is_new {
            let inputs = Inputs {
                diagnosis: None,
                detection: Some(&*self.detection),
            };
            self.journal.note(journal_entry(inputs));
            self.steps.take(inputs, self.action.block());
            self.detection_is_new = false;
        }
    }

    fn publish(&mut self, cause: Cause, stamp: Stamp, clock: &dyn Clock) -> Result<u64, PortError> {
        let action = self.action.block();
        action.cause = cause;
        action.valid_until_ns = clock.now_ns() + self.validity_ns;
        self.alarm = AlarmCount {
            stands: action.alarm != 0,
            count: action.alarm_count,
        };
        self.step = ModelStep {
            belief: action.step_belief,
            count: action.step_count,
            action: action.step_action,
            observation: action.step_observation,
        };
        let states = (action.state_count as usize).min(action.belief.len());
        self.decided = LastDecision {
            seq: action.decision_seq,
            action: action.action,
            wheels: action.answered(),
            p: action.belief[..states].iter().copied().fold(0.0, f64::max),
            // Only a new decision is told; a stop by rule was weighed from nothing.
            weighing: match action.decision_seq == self.decision_reported
                || action.control_mode == ControlMode::Safe as u32
            {
                true => None,
                false => Weighing::new(action),
            },
        };
        self.steps.faults.decide(action);
        if let Some(failure) = self.board.failure() {
            return Err(failure);
        }
        self.journal.answer(&*self.action);
        self.action.send(stamp, clock)
    }

    fn prepare(&mut self) -> Result<(), PortError> {
        self.action.prepare()
    }

    fn has_input(&self) -> bool {
        self.diagnoses.is_waiting()
    }

    fn after(&mut self, health: &mut HealthBoard, now_ns: u64) {
        health.add_input(&self.detection_account);
        self.report(health, now_ns);
        let (steps, journal) = (&mut self.steps, &mut self.journal);
        self.board.turn(steps, journal, health, now_ns);
        let LastDecision {
            seq,
            action,
            wheels,
            p,
            weighing,
        } = self.decided;
        if seq != self.decision_reported {
            health.event(now_ns, EventKind::Action, action, p, wheels.to_event());
            if let Some((what, p, value)) = weighing.as_ref().map(Weighing::to_event) {
                health.event(now_ns, EventKind::Weighed, what, p, value);
            }
            self.decision_reported = seq;
        }
    }

    fn keep_journal(&mut self, stamp: Stamp, clock: &dyn Clock) -> Result<(), PortError> {
        self.journal.publish(&self.steps, stamp, clock)
    }
}
