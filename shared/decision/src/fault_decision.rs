//! Decisions about the leaves of the fault tree: the identifier's belief is the evidence.

use vigil_blocks::{Action, ControlMode, DetectionBelief, FaultBelief, RecoveryKind};
use vigil_robot::{Description, FaultTree};

use crate::action_hysteresis::ActionHysteresis;
use crate::alarm_fusion::Situation;
use crate::decision_process::{DecisionProcess, DecisionRule, Instruction};
use crate::evidence::{self, Effect, EpochEvidence};
use crate::inputs::Inputs;
use crate::mapping::{self, Compensation, StateMeaning, Subject, SupervisorError};
use crate::settings::Settings;

/// Tracks the belief over the leaves of the fault tree, nominal and unknown, and chooses actions.
pub(crate) struct FaultDecision {
    process: DecisionProcess,
    tree_hash: u64,
    states: Vec<StateMeaning>,
    compensation: Vec<Compensation>,
    epoch_ns: u64,
    epoch_t_capture_ns: Option<u64>,
    gathered: EpochEvidence,
    hysteresis: ActionHysteresis,
    /// The model knows how old the unknown is. Then its transitions are for that alone: what is
    /// wrong the identifier says, in every epoch.
    knows_age: bool,
    /// True while the present action stands although another is better.
    is_held: bool,
    instruction: Option<Instruction>,
}

impl FaultDecision {
    /// # Errors
    /// [`SupervisorError`] naming what does not fit.
    pub(crate) fn new(
        process: DecisionProcess,
        tree: &FaultTree,
        robot: &Description,
        settings: &Settings,
        compensation: Vec<Compensation>,
    ) -> Result<Self, SupervisorError> {
        let states = mapping::states(&process.model, tree, robot)?;
        mapping::check_compensation(&process.model, &states, &process.actions, &compensation)?;
        let hold_epochs = (settings.hold_s * 1e3 / settings.epoch_ms).ceil() as u32;
        let unknown = states.iter().filter(|m| m.subject == Subject::Unknown);
        let knows_age = unknown.count() > 1;
        let hysteresis = match knows_age {
            true => ActionHysteresis::at_once(),
            false => ActionHysteresis::new(hold_epochs),
        };
        let mut rule = Self {
            process,
            tree_hash: tree.hash(),
            states,
            compensation,
            epoch_ns: (settings.epoch_ms * 1e6) as u64,
            epoch_t_capture_ns: None,
            gathered: EpochEvidence::new(),
            hysteresis,
            knows_age,
            is_held: false,
            instruction: None,
        };
        rule.begin();
        Ok(rule)
    }

    /// A run begins with nothing wrong, as the identifier's does. The model's own start is what its
    /// policy was solved for.
    fn begin(&mut self) {
        let is_nominal = |m: &StateMeaning| f64::from(u8::from(m.subject == Subject::Node(0)));
        for (weight, meaning) in self.process.scratch.iter_mut().zip(&self.states) {
            *weight = is_nominal(meaning);
        }
        self.process.tracker.anchor(&self.process.scratch);
        self.decide(false);
    }

    fn take_diagnosis(&mut self, diagnosis: &FaultBelief, alarm: bool) {
        if diagnosis.run_id != self.process.run_id {
            self.reset();
            self.process.run_id = diagnosis.run_id;
        }
        let effect = self.gathered.add(diagnosis, &self.states, alarm);
        let timed = self.epoch_is_over(diagnosis.header.t_capture_ns);
        let process = &mut self.process;
        process.control_mode = ControlMode::Policy;
        if effect == Effect::Anchor {
            let belief = process.tracker.belief();
            evidence::weights(diagnosis, &self.states, alarm, belief, &mut process.scratch);
            process.tracker.anchor(&process.scratch);
            process.log_evidence = 0.0;
            self.decide(timed);
        } else if timed {
            // A call is one step of the model, however long it takes: it ends with a reset.
            if self.hysteresis.called().is_none() {
                process
                    .tracker
                    .predict(&process.model, process.choice.action);
            }
            self.gathered.take(&mut process.scratch);
            let evidence = process.tracker.weigh(&process.scratch);
            if let Some(log_probability) = process.log_probability(evidence) {
                process.log_evidence = log_probability;
            }
            let belief = process.tracker.belief();
            evidence::weights(diagnosis, &self.states, alarm, belief, &mut process.scratch);
            let belief = process.tracker.belief();
            if self.knows_age || evidence::has_drifted(belief, &process.scratch) {
                process.tracker.anchor(&process.scratch);
            }
            self.decide(timed);
        }
    }

    /// True once per epoch, by differences of the capture time; a jump back begins a new epoch.
    fn epoch_is_over(&mut self, t_capture_ns: u64) -> bool {
        let over = self.epoch_t_capture_ns.is_none_or(|last_ns| {
            t_capture_ns
                .checked_sub(last_ns)
                .is_none_or(|passed| passed >= self.epoch_ns)
        });
        if over {
            self.epoch_t_capture_ns = Some(t_capture_ns);
        }
        over
    }

    /// The identifier is lost. The detector says how probable a fault is, the belief before the
    /// loss which one. Before an alarm the detector's odds mean nothing.
    fn fall_back(&mut self, detection: &DetectionBelief, alarm: bool) {
        let p_fault = match alarm {
            true => detection.p_fault.clamp(0.0, 1.0),
            false => 0.0,
        };
        let belief = self.process.tracker.belief();
        let is_nominal = |meaning: &StateMeaning| meaning.subject == Subject::Node(0);
        let faulty: f64 = belief
            .iter()
            .zip(&self.states)
            .filter(|(_, m)| !is_nominal(m))
            .map(|(b, _)| b)
            .sum();
        let others = self.states.iter().filter(|m| !is_nominal(m)).count() as f64;
        let scratch = self.process.scratch.iter_mut();
        for ((weight, b), meaning) in scratch.zip(belief).zip(&self.states) {
            *weight = if is_nominal(meaning) {
                1.0 - p_fault
            } else if faulty > 0.0 {
                p_fault * b / faulty
            } else {
                p_fault / others
            };
        }
        self.process.tracker.anchor(&self.process.scratch);
        self.process.control_mode = ControlMode::Fallback;
        let timed = self.epoch_is_over(detection.header.t_capture_ns);
        self.decide(timed);
    }

    fn decide(&mut self, timed: bool) {
        let process = &mut self.process;
        let belief = process.tracker.belief();
        let best = process.decider.decide(belief).choice();
        let values = process.worth.values(&process.decider, belief);
        let current = self.instruction.map(|instruction| instruction.action);
        process.choice = self
            .hysteresis
            .decide(current, best, values, &process.actions, timed);
        let action = process.choice.action;
        self.is_held = current == Some(action) && action != best.action;
    }

    fn instruction(&self) -> Instruction {
        if self.process.control_mode == ControlMode::Safe {
            return self.process.safe_stop();
        }
        let action = self.process.choice.action;
        // The belief no longer speaks for a held action, so its wheel stays what it was.
        let held = self
            .instruction
            .filter(|last| self.is_held && last.action == action);
        if let Some(held) = held {
            return held;
        }
        let kind = self.process.kind(action);
        let wheel = match kind {
            RecoveryKind::Compensate => self.most_probable_wheel(true),
            RecoveryKind::IgnoreEncoder => self.most_probable_wheel(false),
            _ => None,
        };
        Instruction {
            action,
            kind,
            wheel,
        }
    }

    fn most_probable_wheel(&self, stuck: bool) -> Option<usize> {
        let mut best = (None, 0.0);
        for (meaning, b) in self.states.iter().zip(self.process.tracker.belief()) {
            if meaning.wheel.is_some() && meaning.stuck == stuck && *b > best.1 {
                best = (meaning.wheel, *b);
            }
        }
        best.0
    }
}

impl DecisionRule for FaultDecision {
    fn take(&mut self, inputs: Inputs<'_>, situation: Situation) {
        let is_sound =
            |diagnosis: &FaultBelief| evidence::is_sound(diagnosis, &self.states, self.tree_hash);
        let diagnosis = inputs.diagnosis.filter(|diagnosis| is_sound(diagnosis));
        let detection = inputs.detection.filter(|d| d.p_fault.is_finite());
        if diagnosis.is_some() != inputs.diagnosis.is_some() {
            self.process.refuse();
            // A diagnosis that is no probability is as good as none.
            self.miss(1);
        }
        if detection.is_some() != inputs.detection.is_some() {
            self.process.refuse();
        }
        if detection.is_some() {
            self.process.losses.detection();
        }
        match (diagnosis, detection) {
            (Some(diagnosis), _) => {
                if self.process.losses.diagnosis() {
                    self.gathered.forget();
                }
                self.take_diagnosis(diagnosis, situation.alarm);
            }
            (None, Some(detection)) if self.process.losses.identifier_is_lost() => {
                self.fall_back(detection, situation.alarm);
            }
            _ => {}
        }
    }

    fn take_blindly(&mut self, inputs: Inputs<'_>) {
        if inputs.diagnosis.is_some() {
            self.process.losses.diagnosis();
        }
        if inputs.detection.is_some() {
            self.process.losses.detection();
        }
        self.process.control_mode = ControlMode::Safe;
        self.gathered.forget();
    }

    fn miss(&mut self, count: u32) {
        if self.process.losses.miss(count) {
            self.process.control_mode = ControlMode::Safe;
            self.gathered.forget();
        }
    }

    fn reset(&mut self) {
        self.process.reset();
        self.gathered.forget();
        self.hysteresis.reset();
        self.epoch_t_capture_ns = None;
        self.begin();
    }

    fn latched(&self) -> Option<usize> {
        self.hysteresis.called()
    }

    fn write(&mut self, action: &mut Action) {
        let instruction = self.instruction();
        if self.instruction != Some(instruction) {
            self.instruction = Some(instruction);
            self.process.decision_seq += 1;
        }
        self.process.write(instruction, action);
        let compensated = instruction
            .wheel
            .filter(|_| instruction.kind == RecoveryKind::Compensate);
        let counter =
            compensated.and_then(|wheel| self.compensation.iter().find(|c| c.wheel == wheel));
        if let Some(counter) = counter {
            action.curvature_gain = counter.curvature_gain;
            action.curvature_offset = counter.curvature_offset_1_m;
        }
    }
}
