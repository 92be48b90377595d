//! Decisions about exceptions of the navigation: symptoms and outcomes are the evidence, and what
//! the identifier says about the hardware.

use vigil_blocks::{
    Action, ActionOutcome, Carryover, ControlMode, DetectionBelief, FaultBelief, RecoveryKind,
};
use vigil_checkpoint::Checkpoint;
use vigil_robot::{Description, FaultTree};

use crate::alarm_fusion::Situation;
use crate::decision_process::{DecisionProcess, DecisionRule, Step};
use crate::epoch::{End, Epoch, Limits, SymptomKinds};
use crate::error::SupervisorError;
use crate::hardware_belief::HardwareBelief;
use crate::inputs::Inputs;
use crate::latch::Latch;
use crate::mapping::{ActionMeaning, Compensation};
use crate::observations::{Observations, actions_with_outcome};
use crate::settings::Settings;
use crate::state_belief::{MOVED, distance};
use crate::wheels::Wheels;

/// Tracks the belief over exceptions, one step an epoch, and chooses actions.
///
/// At the end of an [`Epoch`] the tracker takes its set as one observation. What the identifier
/// says about the hardware is taken over then, and at once when it moves the belief. An action that
/// is not done mends nothing: where the robot says that it failed, where it takes longer than any
/// may, and where a symptom rises before its end, the step is one of following the path. Only of
/// what reports its outcome as an observation ([`actions_with_outcome`]; GO, NP) the failure is a
/// step of its own: the model knows what it says that no outcome came. A set that is impossible
/// after the action, or of which the model has no observation, is counted, and the belief becomes
/// the prediction with 0.01 of the start belief mixed in.
///
/// A call for help, or a task given up, stands until a new run or a reset, whatever is believed
/// meanwhile: a robot that stands looks healthy. A new run resets the belief, unless its first
/// frame says that the action succeeded: then that action is the model's step.
#[derive(Checkpoint)]
pub(crate) struct SymptomDecision {
    process: DecisionProcess,
    #[checkpoint(fixed)]
    observations: Observations,
    /// By action: whether it reports its outcome as an observation.
    #[checkpoint(fixed)]
    reports_outcome: Vec<bool>,
    #[checkpoint(each)]
    hardware: Option<HardwareBelief>,
    wheels: Wheels,
    epoch: Epoch,
    epoch_ns: u64,
    action_ns: u64,
    /// The call for help, or the end of the task, that stands.
    latch: Latch,
    /// Whether the robot was told to stop, and whether the choice was put off.
    last: Option<(bool, bool)>,
}

impl SymptomDecision {
    /// # Errors
    /// [`SupervisorError`] naming what does not fit.
    pub(crate) fn new(
        mut process: DecisionProcess,
        tree: &FaultTree,
        robot: &Description,
        settings: &Settings,
        compensation: Vec<Compensation>,
    ) -> Result<Self, SupervisorError> {
        let (model, actions) = (&process.model, &process.actions);
        let hardware = HardwareBelief::new(model, tree, settings.lost_state.as_deref())?;
        let wheels = Wheels::new(model, actions, tree, robot, compensation)?;
        let observations = Observations::new(model, &settings.symptoms)?;
        let reports_outcome = actions_with_outcome(model, &settings.symptoms)?;
        process.decision_seq = 1;
        let mut rule = Self {
            process,
            observations,
            reports_outcome,
            hardware,
            wheels,
            epoch: Epoch::new(SymptomKinds::new(&settings.symptoms)),
            epoch_ns: (settings.epoch_ms * 1e6) as u64,
            action_ns: (settings.action_max_s * 1e9) as u64,
            latch: Latch::default(),
            last: None,
        };
        rule.choose();
        Ok(rule)
    }

    fn take_diagnosis(&mut self, diagnosis: &FaultBelief, situation: Situation) {
        self.begin_run(diagnosis.run_id);
        let Some(hardware) = &mut self.hardware else {
            return;
        };
        let (answerable, belief) = (self.wheels.answerable(), self.process.tracker.belief());
        hardware.take(diagnosis, answerable, situation, belief);
        let wheels_moved = self.wheels.have_moved(diagnosis);
        if wheels_moved {
            self.wheels.take(diagnosis);
        }
        self.follow_hardware(wheels_moved);
    }

    fn take_detection(&mut self, detection: &DetectionBelief, is_lost: bool, situation: Situation) {
        self.begin_run(detection.run_id);
        self.process.control_mode = ControlMode::Policy;
        if is_lost {
            self.process.control_mode = ControlMode::Fallback;
            self.take_alarm(detection, situation);
        }
        if self.process.is_deferred && situation.hearing.may_latch() {
            let before = self.process.choice.action;
            self.choose();
            if self.process.choice.action != before {
                self.open_decision();
            }
        }
        self.gather(detection);
    }

    /// The epoch goes on; at its end comes a step of the model, and a choice.
    fn gather(&mut self, detection: &DetectionBelief) {
        let limits = self.limits();
        let seq = self.process.decision_seq;
        let Some(end) = self.epoch.take(detection, seq, &limits) else {
            return;
        };
        let set = self.epoch.take_set(detection.header.t_capture_ns, end);
        self.track(set, end);
        let before = self.process.choice.action;
        let has_end = self.has_end(self.process.done());
        let again = end != End::Unfinished && self.latch.action().is_none() && has_end;
        self.choose();
        // What has an end is done again when it is decided again; what goes on, goes on.
        if self.process.choice.action != before || again {
            self.open_decision();
        }
    }

    /// No identifier is heard: the detector says whether something is wrong.
    fn take_alarm(&mut self, detection: &DetectionBelief, situation: Situation) {
        if !(0.0..=1.0).contains(&detection.p_fault) {
            self.process.refuse();
        } else if let Some(hardware) = &mut self.hardware {
            hardware.take_alarm(situation, self.process.tracker.belief());
            self.follow_hardware(false);
        }
    }

    /// Takes over what is known of the hardware if that moves the belief, and decides anew: no step
    /// of the model, so that what the epoch has gathered stays.
    fn follow_hardware(&mut self, wheels_moved: bool) {
        let before = self.process.choice.action;
        if self.take_over(MOVED) || wheels_moved {
            self.choose();
        }
        if self.process.choice.action != before {
            self.open_decision();
        }
    }

    /// Takes over what is known of the hardware; true if that moves the belief by more than
    /// `least`.
    fn take_over(&mut self, least: f64) -> bool {
        let Some(hardware) = &self.hardware else {
            return false;
        };
        let process = &mut self.process;
        let belief = process.tracker.belief();
        hardware.write_joint(belief, process.model.start(), &mut process.scratch);
        let moves = distance(belief, &process.scratch) > least;
        if moves {
            process.tracker.anchor(&process.scratch);
        }
        moves
    }

    fn has_end(&self, action: usize) -> bool {
        self.process.actions.get(action).is_some_and(|m| m.has_end)
    }

    fn limits(&self) -> Limits {
        let unless_latched = |ns: u64| self.latch.action().is_none().then_some(ns);
        let action = self.process.done();
        let own_ns = self.process.actions.get(action).and_then(|m| m.epoch_ns);
        Limits {
            epoch_ns: unless_latched(own_ns.unwrap_or(self.epoch_ns)),
            running_ns: unless_latched(self.action_ns),
            has_end: self.has_end(action),
        }
    }

    /// The action that the model's step is of. What did not end is a step of following the path, or
    /// of the present action where the model cannot follow.
    fn step_action(&self, end: End) -> usize {
        let action = self.process.done();
        let reports_outcome = self.reports_outcome[action];
        if end == End::Done || (end == End::Failed && reports_outcome) {
            return action;
        }
        let follows = |m: &ActionMeaning| m.kind == RecoveryKind::GoOn;
        let follow = self.process.actions.iter().position(follows);
        follow.unwrap_or(action)
    }

    /// One step of the model.
    fn track(&mut self, set: u32, end: End) {
        let action = self.step_action(end);
        let process = &mut self.process;
        // Nothing was seen of an action that was not done: no news.
        if set == 0 && action != process.done() {
            process.tracker.predict(&process.model, action);
            self.take_over(0.0);
            return;
        }
        let observation = self.observations.index(set);
        process.step_count += 1;
        process.step = Step {
            belief: process.belief_count,
            action,
            observation,
        };
        let evidence = match observation {
            Some(z) => process.tracker.update(&process.model, action, z),
            None => {
                process.tracker.predict(&process.model, action);
                process.scratch.fill(0.0);
                process.tracker.weigh(&process.scratch)
            }
        };
        process.log_evidence = process.log_probability(evidence).unwrap_or(0.0);
        self.take_over(0.0);
    }

    fn begin_run(&mut self, run_id: u64) {
        if run_id != self.process.run_id {
            self.reset();
            self.process.run_id = run_id;
        }
    }

    /// A run that begins because the action succeeded: help came, the place was found. It is a step
    /// of the same task, as what the action mends is in the model. What is known of the hardware is
    /// of the last run.
    fn continue_in_run(&mut self, detection: &DetectionBelief) {
        let is_new = detection.run_id != self.process.run_id;
        let is_done = detection.action_seq == self.process.decision_seq
            && detection.action_outcome == ActionOutcome::Succeeded as u32;
        if is_new && is_done && !self.process.is_deferred {
            self.process.run_id = detection.run_id;
            if let Some(hardware) = &mut self.hardware {
                hardware.forget();
            }
            self.wheels.forget();
            self.latch.release();
            self.gather(detection);
        }
    }

    /// Without symptoms no belief is usable: the robot stops.
    fn enter_safe_mode(&mut self) {
        self.process.control_mode = ControlMode::Safe;
        if let Some(hardware) = &mut self.hardware {
            hardware.forget();
        }
    }

    fn choose(&mut self) {
        let process = &mut self.process;
        let best = process.decider.decide(process.tracker.belief()).choice();
        process.choose(best, &mut self.latch, &mut self.wheels);
    }

    /// Opens a new decision, whose outcome is waited for.
    const fn open_decision(&mut self) {
        self.process.decision_seq += 1;
        self.epoch.begin();
    }
}

impl DecisionRule for SymptomDecision {
    fn take(&mut self, inputs: Inputs<'_>, situation: Situation) {
        if let Some(detection) = inputs.detection {
            self.continue_in_run(detection);
        }
        let diagnosis = inputs.diagnosis.filter(|_| !situation.is_refused);
        let refuses = inputs.diagnosis.is_some() && diagnosis.is_none();
        if refuses {
            self.process.refuse();
            self.miss(1);
        }
        let is_lost = diagnosis.is_none() && self.process.losses.identifier_is_lost();
        self.latch.keep_open(situation.forbids_latching(is_lost));
        let hearing = situation.hearing;
        let has_result =
            |it: &&FaultBelief| hearing.is_heard() && !(hearing.waits() && it.is_catching_up());
        if diagnosis.is_some() {
            self.process.losses.diagnosis_alone();
        }
        let told = diagnosis.filter(has_result);
        if let Some(diagnosis) = told {
            self.take_diagnosis(diagnosis, situation);
        }
        match inputs.detection {
            Some(detection) => {
                self.process.losses.detection();
                let is_lost = self.process.losses.identifier_is_lost() || hearing.is_lost();
                let knows = told.is_some() || is_lost || !situation.alarm;
                if knows || self.process.control_mode != ControlMode::Safe {
                    self.take_detection(detection, is_lost, situation);
                }
            }
            // A diagnosis holds no symptoms, and does not make up for missing ones.
            None if !refuses && self.process.losses.no_detection() => self.enter_safe_mode(),
            None => {}
        }
    }

    fn take_blindly(&mut self, inputs: Inputs<'_>) {
        if inputs.diagnosis.is_some() {
            self.process.losses.diagnosis_alone();
        }
        if inputs.detection.is_some() {
            self.process.losses.detection();
        }
        self.enter_safe_mode();
    }

    fn miss(&mut self, count: u32) {
        if self.process.losses.miss(count) {
            self.enter_safe_mode();
        }
    }

    fn reset(&mut self) {
        self.process.reset();
        if let Some(hardware) = &mut self.hardware {
            hardware.forget();
        }
        self.wheels.forget();
        self.epoch.reset();
        self.latch.release();
        self.choose();
        self.open_decision();
    }

    fn improve(&mut self) {
        self.process.improve();
    }

    fn restore(&mut self, left: &Carryover, believed: Option<&FaultBelief>) {
        self.process.restore(left, &mut self.latch);
        if let (Some(believed), Some(hardware)) = (believed, &mut self.hardware) {
            let (answerable, belief) = (self.wheels.answerable(), self.process.tracker.belief());
            let stands = Situation {
                alarm: true,
                ..Situation::default()
            };
            hardware.take(believed, answerable, stands, belief);
            self.wheels.take(believed);
            self.take_over(0.0);
            // What is not heard of yet calls nobody.
            self.latch.keep_open(true);
            let before = self.process.choice.action;
            self.choose();
            if self.process.choice.action != before {
                self.open_decision();
            }
        }
    }

    fn is_sound(&self, diagnosis: &FaultBelief) -> bool {
        let hardware = self.hardware.as_ref();
        hardware.is_none_or(|it| it.is_sound(diagnosis))
    }

    fn origin(&self) -> (u64, u64) {
        (self.process.run_id, self.process.model.hash())
    }

    fn latched(&self) -> Option<usize> {
        self.latch.action()
    }

    fn write(&mut self, action: &mut Action) {
        let instruction = self.process.instruction(&self.wheels);
        // The stop of the safe mode, what is done while a choice is put off, and the end of both
        // are decisions of their own.
        let stops = instruction.kind == RecoveryKind::Stop;
        let now = (stops, self.process.is_deferred);
        let last = self.last.replace(now);
        if last.is_some_and(|last| last != now) {
            self.open_decision();
        }
        self.process.write(instruction, action);
        self.wheels.write(instruction.kind, action);
    }
}
