//! Decisions about exceptions of the navigation: states are told by symptoms and outcomes.

use vigil_blocks::{Action, ControlMode, DetectionBelief, Entry, FaultBelief, RecoveryKind};
use vigil_decision::{Choice, Control, Decider, Evidence, PointBased, Pomdp, Tracker, mdp};
use vigil_inference::FaultTree;
use vigil_setup::schema;

use crate::epoch::Epoch;
use crate::hardware::Hardware;
use crate::mapping::{self, ActionMeaning, SupervisorError};
use crate::observations::Observations;
use crate::policy;
use crate::silence::Silence;
use crate::supervisor::Inputs;
use crate::told::{Decided, Told};

/// Tracks the belief over exceptions, one step an epoch, and chooses actions.
///
/// At the end of an [`Epoch`] the tracker takes its set as one observation, then the identifier's
/// soft evidence. A set that is impossible after the action, or of which the model has no
/// observation, is counted, and the belief becomes the prediction with 0.01 of the start belief
/// mixed in.
pub(crate) struct Exceptions {
    model: Pomdp,
    decider: Decider,
    tracker: Tracker,
    observations: Observations,
    actions: Vec<ActionMeaning>,
    hardware: Option<Hardware>,
    epoch: Epoch,
    epoch_ns: u64,
    silence: Silence,
    scratch: Vec<f64>,
    choice: Choice,
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
        settings: &schema::Supervisor,
        blind_after_misses: u32,
    ) -> Result<Self, SupervisorError> {
        mapping::check_size(&model)?;
        let actions = mapping::actions(&model, &settings.actions)?;
        let solution = mdp::solve(&model)?;
        let decider = policy::decider(&model, &solution, solved, settings)?;
        let state = settings.hardware_state.as_ref().map(|name| {
            let index = model.states().iter().position(|state| state == name);
            index.ok_or_else(|| SupervisorError::HardwareState {
                found: name.clone(),
                allowed: model.states().join(", "),
            })
        });
        let hardware = state
            .transpose()?
            .map(|state| Hardware::new(&model, state, tree.hash()));
        let mut exceptions = Self {
            decider,
            tracker: Tracker::new(&model),
            observations: Observations::new(&model)?,
            actions,
            hardware,
            epoch: Epoch::default(),
            epoch_ns: (settings.epoch_ms * 1e6) as u64,
            silence: Silence::new(blind_after_misses),
            scratch: vec![0.0; model.states().len()],
            choice: Choice {
                action: 0,
                margin: 0.0,
                control: Control::Policy,
            },
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
    pub(crate) fn step(&mut self, entry: Entry<Inputs<'_>>, action: &mut Action) {
        match entry {
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
        if inputs.diagnosis.is_some() && diagnosis.is_none() {
            self.impossible_count = self.impossible_count.saturating_add(1);
            self.miss(1);
        }
        if let Some(diagnosis) = diagnosis {
            let was_lost = self.silence.identifier_heard();
            self.take_diagnosis(diagnosis, was_lost);
        }
        if let Some(detection) = inputs.detection {
            self.silence.detection();
            self.take_detection(detection);
        }
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
            hardware.anchored(self.tracker.belief(), self.model.start(), &mut self.scratch);
            self.tracker.anchor(&self.scratch);
            // No step of the model: what the epoch has gathered stays.
            let action = self.choice.action;
            self.choose();
            if self.choice.action != action {
                self.ask();
            }
        }
    }

    fn take_detection(&mut self, detection: &DetectionBelief) {
        self.begin_run(detection.run_id);
        self.control_mode = if self.silence.identifier_is_lost() {
            ControlMode::Fallback
        } else {
            ControlMode::Policy
        };
        if self.epoch.take(detection, self.decision_seq, self.epoch_ns) {
            let set = self.epoch.take_set(detection.header.t_capture_ns);
            self.track(set);
            let follows = |action: usize| {
                let kind = self.actions.get(action).map(|m| m.kind);
                kind == Some(RecoveryKind::GoOn)
            };
            let before = self.choice.action;
            let followed = follows(before);
            self.choose();
            // What has an end is done again when it is decided again; following goes on.
            if self.choice.action != before || !followed {
                self.ask();
            }
        }
    }

    /// One step of the model.
    fn track(&mut self, set: u32) {
        let action = self.choice.action;
        let evidence = match self.observations.of(set) {
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
            self.control_mode = ControlMode::Safe;
            if let Some(hardware) = &mut self.hardware {
                hardware.forget();
            }
        }
    }

    fn reset(&mut self) {
        self.tracker.reset();
        self.decider.reset();
        if let Some(hardware) = &mut self.hardware {
            hardware.forget();
        }
        self.epoch.reset();
        self.log_evidence = 0.0;
        self.control_mode = ControlMode::Policy;
        self.choose();
        self.ask();
    }

    fn choose(&mut self) {
        self.choice = self.decider.decide(self.tracker.belief()).choice();
    }

    /// A new decision, whose outcome is waited for.
    const fn ask(&mut self) {
        self.decision_seq += 1;
        self.epoch.ask();
    }

    fn decided(&self) -> Decided {
        let action = self.choice.action;
        if self.control_mode == ControlMode::Safe {
            return Decided::stop(&self.actions, action);
        }
        let kind = self.actions.get(action).map(|m| m.kind);
        Decided {
            action,
            kind: kind.unwrap_or(RecoveryKind::Stop),
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
        let told = Told {
            decided,
            choice: self.choice,
            meanings: &self.actions,
            control_mode: self.control_mode,
        };
        told.write(&self.model, &self.tracker, &self.decider, action);
    }
}
