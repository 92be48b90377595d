//! Decisions about exceptions of the navigation: symptoms and outcomes are the evidence.

use vigil_blocks::{Action, ControlMode, DetectionBelief, FaultBelief, RecoveryKind};
use vigil_pomdp::policy::choose_among;
use vigil_robot::FaultTree;

use crate::alarm_fusion::Situation;
use crate::decision_process::{DecisionProcess, DecisionRule, Instruction};
use crate::epoch::{End, Epoch, Limits};
use crate::error::SupervisorError;
use crate::hardware::HardwareEvidence;
use crate::inputs::Inputs;
use crate::latch::Latch;
use crate::mapping::{self, ActionMeaning};
use crate::observations::Observations;
use crate::settings::Settings;

/// Tracks the belief over exceptions, one step an epoch, and chooses actions.
///
/// At the end of an [`Epoch`] the tracker takes its set as one observation, then the identifier's
/// soft evidence. An action that is not done mends nothing: where the robot says that it failed,
/// where it takes longer than any may, and where a symptom rises before its end, the step is one of
/// following the path. Only of what reports its outcome as an observation (GO, NP) the failure is a
/// step of its own: the model knows what it says that no outcome came. A set that is impossible
/// after the action, or of which the model has no observation, is counted, and the belief becomes
/// the prediction with 0.01 of the start belief mixed in.
///
/// A call for help, or a task given up, stands until a new run or a reset, whatever is believed
/// meanwhile: a robot that stands looks healthy.
pub(crate) struct SymptomDecision {
    process: DecisionProcess,
    observations: Observations,
    hardware: Option<HardwareEvidence>,
    epoch: Epoch,
    epoch_ns: u64,
    action_ns: u64,
    /// The call for help, or the end of the task, that stands.
    latch: Latch,
    last_kind: Option<RecoveryKind>,
}

impl SymptomDecision {
    /// # Errors
    /// [`SupervisorError`] naming what does not fit.
    pub(crate) fn new(
        mut process: DecisionProcess,
        tree: &FaultTree,
        settings: &Settings,
    ) -> Result<Self, SupervisorError> {
        let model = &process.model;
        let state = |key, name: &Option<String>| mapping::state(model, key, name.as_deref());
        let lost = state("lost_state", &settings.lost_state)?;
        let hardware = state("hardware_state", &settings.hardware_state)?
            .map(|state| HardwareEvidence::new(model, state, lost, tree.hash()));
        let observations = Observations::new(model)?;
        process.decision_seq = 1;
        let mut rule = Self {
            process,
            observations,
            hardware,
            epoch: Epoch::default(),
            epoch_ns: (settings.epoch_ms * 1e6) as u64,
            action_ns: (settings.action_max_s * 1e9) as u64,
            latch: Latch::default(),
            last_kind: None,
        };
        rule.choose();
        Ok(rule)
    }

    fn take_diagnosis(&mut self, diagnosis: &FaultBelief, was_lost: bool) {
        self.begin_run(diagnosis.run_id);
        let Some(hardware) = &mut self.hardware else {
            return;
        };
        if was_lost {
            hardware.forget();
        }
        if hardware.add(diagnosis) {
            self.anchor();
            self.choose_between_epochs();
        }
    }

    fn take_detection(&mut self, detection: &DetectionBelief) {
        self.begin_run(detection.run_id);
        self.process.control_mode = ControlMode::Policy;
        if self.process.losses.identifier_is_lost() {
            self.process.control_mode = ControlMode::Fallback;
            self.take_alarm(detection);
        }
        let limits = self.limits();
        let Some(end) = self
            .epoch
            .take(detection, self.process.decision_seq, &limits)
        else {
            return;
        };
        let set = self.epoch.take_set(detection.header.t_capture_ns, end);
        self.track(set, end);
        let before = self.process.choice.action;
        let again = end != End::Unfinished
            && self.latch.action().is_none()
            && has_end(self.process.kind(before));
        self.choose();
        // What has an end is done again when it is decided again; what goes on, goes on.
        if self.process.choice.action != before || again {
            self.open_decision();
        }
    }

    /// The identifier is lost: the detector says whether something is wrong.
    fn take_alarm(&mut self, detection: &DetectionBelief) {
        if !(0.0..=1.0).contains(&detection.p_fault) {
            self.process.refuse();
        } else if let Some(hardware) = &mut self.hardware
            && hardware.add_alarm(detection)
        {
            self.anchor();
            self.choose_between_epochs();
        }
    }

    /// Takes over the probabilities of the identifier, or of the detector in its place.
    fn anchor(&mut self) {
        let Some(hardware) = &self.hardware else {
            return;
        };
        let process = &mut self.process;
        let belief = process.tracker.belief();
        hardware.anchored(belief, process.model.start(), &mut process.scratch);
        process.tracker.anchor(&process.scratch);
    }

    /// No step of the model: what the epoch has gathered stays.
    fn choose_between_epochs(&mut self) {
        let before = self.process.choice.action;
        self.choose();
        if self.process.choice.action != before {
            self.open_decision();
        }
    }

    fn limits(&self) -> Limits {
        let unless_latched = |ns: u64| self.latch.action().is_none().then_some(ns);
        Limits {
            epoch_ns: unless_latched(self.epoch_ns),
            running_ns: unless_latched(self.action_ns),
            has_end: has_end(self.process.kind(self.process.choice.action)),
        }
    }

    /// The action that the model's step is of. What did not end is a step of following the path, or
    /// of the present action where the model cannot follow.
    fn step_action(&self, end: End) -> usize {
        let action = self.process.choice.action;
        let reports_outcome = matches!(
            self.process.kind(action),
            RecoveryKind::GoThrough | RecoveryKind::NewPath
        );
        if end == End::Done || (end == End::Failed && reports_outcome) {
            return action;
        }
        let follows = |m: &ActionMeaning| m.kind == RecoveryKind::GoOn;
        let follow = self.process.actions.iter().position(follows);
        follow.unwrap_or(action)
    }

    /// What the end of an action says about the unknown.
    fn remember(&mut self, set: u32, end: End) {
        let kind = self.process.kind(self.process.choice.action);
        let Some(hardware) = &mut self.hardware else {
            return;
        };
        match kind {
            RecoveryKind::Relocalise if end != End::Unfinished => hardware.sought(),
            RecoveryKind::GoOn if set == 0 => hardware.quiet(),
            _ => {}
        }
    }

    /// One step of the model.
    fn track(&mut self, set: u32, end: End) {
        self.remember(set, end);
        let action = self.step_action(end);
        let process = &mut self.process;
        let evidence = match self.observations.index(set) {
            Some(z) => process.tracker.update(&process.model, action, z),
            None => {
                process.tracker.predict(&process.model, action);
                process.scratch.fill(0.0);
                process.tracker.weigh(&process.scratch)
            }
        };
        process.log_evidence = process.log_probability(evidence).unwrap_or(0.0);
        let Some(hardware) = &mut self.hardware else {
            return;
        };
        hardware.take(&mut process.scratch);
        let soft = process.tracker.weigh(&process.scratch);
        process.log_evidence += process.log_probability(soft).unwrap_or(0.0);
        if hardware.has_drifted(process.tracker.belief()) {
            self.anchor();
        }
    }

    fn begin_run(&mut self, run_id: u64) {
        if run_id != self.process.run_id {
            self.reset();
            self.process.run_id = run_id;
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
        let belief = process.tracker.belief();
        let mut best = process.decider.decide(belief).choice();
        if let Some(hardware) = &self.hardware
            && !hardware.allows(best.action)
        {
            let values = process.worth.values(&process.decider, belief);
            let votes = process.decider.votes();
            best = choose_among(values, votes, |action| hardware.allows(action));
        }
        let actions = &process.actions;
        let kind = |action: usize| actions.get(action).map_or(RecoveryKind::Stop, |m| m.kind);
        process.choice = self.latch.choose(best, kind);
    }

    /// Opens a new decision, whose outcome is waited for.
    const fn open_decision(&mut self) {
        self.process.decision_seq += 1;
        self.epoch.begin();
    }
}

impl DecisionRule for SymptomDecision {
    fn take(&mut self, inputs: Inputs<'_>, _: Situation) {
        let hardware = self.hardware.as_ref();
        let is_sound = |d: &&FaultBelief| hardware.is_none_or(|h| h.is_sound(d));
        let diagnosis = inputs.diagnosis.filter(is_sound);
        let refuses = inputs.diagnosis.is_some() && diagnosis.is_none();
        if refuses {
            self.process.refuse();
            self.miss(1);
        }
        if let Some(diagnosis) = diagnosis {
            let was_lost = self.process.losses.diagnosis_alone();
            self.take_diagnosis(diagnosis, was_lost);
        }
        match inputs.detection {
            Some(detection) => {
                self.process.losses.detection();
                self.take_detection(detection);
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
            hardware.reset();
        }
        self.epoch.reset();
        self.latch.release();
        self.choose();
        self.open_decision();
    }

    fn latched(&self) -> Option<usize> {
        self.latch.action()
    }

    fn write(&mut self, action: &mut Action) {
        let instruction = match self.process.control_mode {
            ControlMode::Safe => self.process.safe_stop(),
            _ => Instruction {
                action: self.process.choice.action,
                kind: self.process.kind(self.process.choice.action),
                wheel: None,
            },
        };
        // The stop of the safe mode, and its end, are decisions of their own.
        let stops = |kind| kind == RecoveryKind::Stop;
        let last = self.last_kind.replace(instruction.kind);
        if last.is_some_and(|last| stops(last) != stops(instruction.kind)) {
            self.open_decision();
        }
        self.process.write(instruction, action);
    }
}

/// True for what a robot does and then has done.
const fn has_end(kind: RecoveryKind) -> bool {
    use RecoveryKind as R;
    match kind {
        R::NewPath | R::Relocalise | R::GoThrough | R::MoveAway | R::CallForHelp | R::GiveUp => {
            true
        }
        R::None | R::GoOn | R::SlowDown | R::Stop | R::Compensate | R::IgnoreEncoder => false,
    }
}
