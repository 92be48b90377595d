//! Decisions about exceptions of the navigation: states are told by symptoms and outcomes.

use crate::settings::Settings;
use vigil_blocks::{Action, ControlMode, DetectionBelief, Entry, FaultBelief, RecoveryKind};
use vigil_pomdp::policy::choose_among;
use vigil_pomdp::{Choice, Control, Decider, Evidence, PointBased, Pomdp, Tracker, mdp};
use vigil_robot::FaultTree;

use crate::epoch::{End, Epoch, Limits};
use crate::hardware::Hardware;
use crate::mapping::{self, ActionMeaning, SupervisorError};
use crate::observations::Observations;
use crate::policy::{self, Worth};
use crate::silence::Silence;
use crate::supervisor::Inputs;
use crate::told::{Decision, Instruction};
use crate::watch::Situation;

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
pub(crate) struct Exceptions {
    model: Pomdp,
    decider: Decider,
    worth: Worth,
    tracker: Tracker,
    observations: Observations,
    actions: Vec<ActionMeaning>,
    hardware: Option<Hardware>,
    epoch: Epoch,
    epoch_ns: u64,
    action_ns: u64,
    silence: Silence,
    scratch: Vec<f64>,
    choice: Choice,
    /// The call for help, or the end of the task, that stands.
    held: Option<usize>,
    told: Option<RecoveryKind>,
    decision_seq: u64,
    log_evidence: f64,
    impossible_count: u32,
    control_mode: ControlMode,
    run_id: u64,
}

impl Exceptions {
    /// # Errors
    /// [`SupervisorError`] naming what does not fit.
    pub(crate) fn new(
        model: Pomdp,
        solved: Option<&PointBased>,
        tree: &FaultTree,
        settings: &Settings,
        blind_after_misses: u32,
    ) -> Result<Self, SupervisorError> {
        mapping::check_size(&model)?;
        let actions = mapping::actions(&model, &settings.actions)?;
        let solution = mdp::solve(&model)?;
        let decider = policy::decider(&model, &solution, solved, settings)?;
        let state = |key, name: &Option<String>| mapping::state(&model, key, name.as_deref());
        let lost = state("lost_state", &settings.lost_state)?;
        let hardware = state("hardware_state", &settings.hardware_state)?
            .map(|state| Hardware::new(&model, state, lost, tree.hash()));
        let mut exceptions = Self {
            decider,
            worth: Worth::new(solution, actions.len()),
            tracker: Tracker::new(&model),
            observations: Observations::new(&model)?,
            actions,
            hardware,
            epoch: Epoch::default(),
            epoch_ns: (settings.epoch_ms * 1e6) as u64,
            action_ns: (settings.action_max_s * 1e9) as u64,
            silence: Silence::new(blind_after_misses),
            scratch: vec![0.0; model.states().len()],
            choice: Choice {
                action: 0,
                margin: 0.0,
                control: Control::Policy,
            },
            held: None,
            told: None,
            decision_seq: 1,
            log_evidence: 0.0,
            impossible_count: 0,
            control_mode: ControlMode::Policy,
            run_id: 0,
            model,
        };
        exceptions.choose();
        Ok(exceptions)
    }

    /// See [`crate::Supervisor::step`].
    pub(crate) fn step(&mut self, entry: Entry<Inputs<'_>>, seen: Situation, action: &mut Action) {
        match entry {
            Entry::Frame(inputs) if seen.is_blind => self.take_blindly(inputs),
            Entry::Frame(inputs) => self.take(inputs),
            Entry::Missed(count) => self.miss(count),
            Entry::Reset => self.reset(),
            Entry::Budget(_) => {}
        }
        self.write(action);
    }

    fn take(&mut self, inputs: Inputs<'_>) {
        let hardware = self.hardware.as_ref();
        let is_sound = |d: &&FaultBelief| hardware.is_none_or(|h| h.is_sound(d));
        let diagnosis = inputs.diagnosis.filter(is_sound);
        let refuses = inputs.diagnosis.is_some() && diagnosis.is_none();
        if refuses {
            self.impossible_count = self.impossible_count.saturating_add(1);
            self.miss(1);
        }
        if let Some(diagnosis) = diagnosis {
            let was_lost = self.silence.identifier_heard();
            self.take_diagnosis(diagnosis, was_lost);
        }
        match inputs.detection {
            Some(detection) => {
                self.silence.detection();
                self.take_detection(detection);
            }
            // An identifier that is heard does not make good for symptoms that are not.
            None if !refuses && self.silence.no_detection() => self.go_blind(),
            None => {}
        }
    }

    /// The detector sees nothing: who is heard is known, what is said is not.
    const fn take_blindly(&mut self, inputs: Inputs<'_>) {
        if inputs.diagnosis.is_some() {
            self.silence.identifier_heard();
        }
        if inputs.detection.is_some() {
            self.silence.detection();
        }
        self.go_blind();
    }

    /// The call for help, or the end of the task, that stands.
    pub(crate) const fn latched(&self) -> Option<usize> {
        self.held
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
            self.take_over();
        }
    }

    /// The identifier's probabilities, or the detector's in its place. No step of the model: what
    /// the epoch has gathered stays.
    fn take_over(&mut self) {
        let Some(hardware) = &self.hardware else {
            return;
        };
        hardware.anchored(self.tracker.belief(), self.model.start(), &mut self.scratch);
        self.tracker.anchor(&self.scratch);
        let action = self.choice.action;
        self.choose();
        if self.choice.action != action {
            self.ask();
        }
    }

    fn take_detection(&mut self, detection: &DetectionBelief) {
        self.begin_run(detection.run_id);
        self.control_mode = ControlMode::Policy;
        if self.silence.identifier_is_lost() {
            self.control_mode = ControlMode::Fallback;
            self.take_alarm(detection);
        }
        let Some(end) = self
            .epoch
            .take(detection, self.decision_seq, &self.limits())
        else {
            return;
        };
        let set = self.epoch.take_set(detection.header.t_capture_ns, end);
        self.track(set, end);
        let before = self.choice.action;
        let again = end != End::Unfinished && self.held.is_none() && has_end(self.kind(before));
        self.choose();
        // What has an end is done again when it is decided again; what goes on, goes on.
        if self.choice.action != before || again {
            self.ask();
        }
    }

    /// The identifier is lost: the detector says whether something is wrong.
    fn take_alarm(&mut self, detection: &DetectionBelief) {
        if !(0.0..=1.0).contains(&detection.p_fault) {
            self.impossible_count = self.impossible_count.saturating_add(1);
        } else if let Some(hardware) = &mut self.hardware
            && hardware.add_alarm(detection)
        {
            self.take_over();
        }
    }

    fn limits(&self) -> Limits {
        let unless_held = |ns: u64| self.held.is_none().then_some(ns);
        Limits {
            epoch_ns: unless_held(self.epoch_ns),
            running_ns: unless_held(self.action_ns),
            has_end: has_end(self.kind(self.choice.action)),
        }
    }

    fn kind(&self, action: usize) -> RecoveryKind {
        self.actions
            .get(action)
            .map_or(RecoveryKind::Stop, |m| m.kind)
    }

    /// The action that the model's step is of: without one that follows the path, the present one.
    fn step_of(&self, end: End) -> usize {
        let action = self.choice.action;
        let speaks = matches!(
            self.kind(action),
            RecoveryKind::GoThrough | RecoveryKind::NewPath
        );
        if end == End::Done || (end == End::Failed && speaks) {
            return action;
        }
        let follows = |m: &ActionMeaning| m.kind == RecoveryKind::GoOn;
        self.actions.iter().position(follows).unwrap_or(action)
    }

    /// What the end of an action says about the unknown.
    fn remember(&mut self, set: u32, end: End) {
        let kind = self.kind(self.choice.action);
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
        let action = self.step_of(end);
        let evidence = match self.observations.index(set) {
            Some(z) => self.tracker.update(&self.model, action, z),
            None => {
                self.tracker.predict(&self.model, action);
                self.scratch.fill(0.0);
                self.tracker.weigh(&self.scratch)
            }
        };
        self.log_evidence = self.account(evidence);
        let Some(hardware) = &mut self.hardware else {
            return;
        };
        hardware.take(&mut self.scratch);
        let soft = self.tracker.weigh(&self.scratch);
        if hardware.has_drifted(self.tracker.belief()) {
            hardware.anchored(self.tracker.belief(), self.model.start(), &mut self.scratch);
            self.tracker.anchor(&self.scratch);
        }
        self.log_evidence += self.account(soft);
    }

    /// The logarithm of the evidence's probability; what is impossible is counted.
    fn account(&mut self, evidence: Evidence) -> f64 {
        match evidence {
            Evidence::Taken(p) => p.max(f64::MIN_POSITIVE).ln(),
            Evidence::Impossible => {
                self.impossible_count = self.impossible_count.saturating_add(1);
                0.0
            }
        }
    }

    fn begin_run(&mut self, run_id: u64) {
        if run_id != self.run_id {
            self.reset();
            self.run_id = run_id;
        }
    }

    fn miss(&mut self, count: u32) {
        if self.silence.miss(count) {
            self.go_blind();
        }
    }

    /// No word of symptoms: the robot stops.
    const fn go_blind(&mut self) {
        self.control_mode = ControlMode::Safe;
        if let Some(hardware) = &mut self.hardware {
            hardware.forget();
        }
    }

    fn reset(&mut self) {
        self.tracker.reset();
        self.decider.reset();
        if let Some(hardware) = &mut self.hardware {
            hardware.reset();
        }
        self.epoch.reset();
        self.log_evidence = 0.0;
        self.control_mode = ControlMode::Policy;
        self.held = None;
        self.choose();
        self.ask();
    }

    fn choose(&mut self) {
        let belief = self.tracker.belief();
        let mut best = self.decider.decide(belief).choice();
        if let Some(hardware) = &self.hardware
            && !hardware.allows(best.action)
        {
            let values = self.worth.values(&self.decider, belief);
            best = choose_among(values, |action| hardware.allows(action));
        }
        self.choice = match self.held {
            Some(held) if held != best.action => Choice {
                action: held,
                margin: 0.0,
                control: Control::Policy,
            },
            _ => best,
        };
        let ends = matches!(
            self.kind(self.choice.action),
            RecoveryKind::CallForHelp | RecoveryKind::GiveUp
        );
        self.held = ends.then_some(self.choice.action);
    }

    /// A new decision, whose outcome is waited for.
    const fn ask(&mut self) {
        self.decision_seq += 1;
        self.epoch.ask();
    }

    fn decided(&self) -> Instruction {
        let action = self.choice.action;
        if self.control_mode == ControlMode::Safe {
            return Instruction::stop(&self.actions, action);
        }
        Instruction {
            action,
            kind: self.kind(action),
            wheel: None,
        }
    }

    fn write(&mut self, action: &mut Action) {
        let decided = self.decided();
        // A stop by rule, and its end, are decisions of their own.
        let stops = |kind| kind == RecoveryKind::Stop;
        if self
            .told
            .is_some_and(|told| stops(told) != stops(decided.kind))
        {
            self.ask();
        }
        self.told = Some(decided.kind);
        action.run_id = self.run_id;
        action.decision_seq = self.decision_seq;
        action.curvature_gain = 1.0;
        action.curvature_offset = 0.0;
        action.log_evidence = self.log_evidence;
        action.impossible_count = self.impossible_count;
        action.lost_stages = self.silence.lost_stages();
        let told = Decision {
            decided,
            choice: self.choice,
            meanings: &self.actions,
            control_mode: self.control_mode,
        };
        told.write(&self.model, &self.tracker, &self.decider, action);
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
