//! Decisions about the leaves of the fault tree: states are told by the identifier.

use crate::settings::Settings;
use vigil_blocks::{Action, ControlMode, DetectionBelief, Entry, FaultBelief, RecoveryKind};
use vigil_pomdp::{Choice, Control, Decider, Evidence, PointBased, Pomdp, Tracker, mdp};
use vigil_robot::Description;
use vigil_robot::FaultTree;

use crate::evidence::{self, Effect, EpochEvidence};
use crate::mapping::{self, ActionMeaning, Compensation, StateMeaning, SupervisorError};
use crate::policy::{self, Worth};
use crate::restraint::Restraint;
use crate::silence::Silence;
use crate::supervisor::Inputs;
use crate::told::{Decision, Instruction};
use crate::watch::Situation;

/// Tracks the belief over the leaves of the fault tree, nominal and unknown, and chooses actions.
pub(crate) struct Leaves {
    model: Pomdp,
    decider: Decider,
    worth: Worth,
    tree_hash: u64,
    tracker: Tracker,
    states: Vec<StateMeaning>,
    actions: Vec<ActionMeaning>,
    compensation: Vec<Compensation>,
    silence: Silence,
    epoch_ns: u64,
    gathered: EpochEvidence,
    restraint: Restraint,
    scratch: Vec<f64>,
    epoch_t_capture_ns: Option<u64>,
    choice: Choice,
    /// True while the present action stands although another is better.
    is_held: bool,
    decided: Option<Instruction>,
    decision_seq: u64,
    log_evidence: f64,
    impossible_count: u32,
    control_mode: ControlMode,
    run_id: u64,
    seen: Situation,
    hold_epochs: u32,
}

impl Leaves {
    /// Builds a supervisor for a decision model whose states are the leaves of `tree`. After
    /// `blind_after_misses` misses in a row without any detection no belief is usable, and the
    /// robot stops.
    ///
    /// # Errors
    /// [`SupervisorError`] naming what does not fit.
    pub(crate) fn new(
        model: Pomdp,
        solved: Option<&PointBased>,
        tree: &FaultTree,
        robot: &Description,
        settings: &Settings,
        compensation: Vec<Compensation>,
        blind_after_misses: u32,
    ) -> Result<Self, SupervisorError> {
        let states = mapping::states(&model, tree, robot)?;
        let actions = mapping::actions(&model, &settings.actions)?;
        mapping::check_compensation(&model, &states, &actions, &compensation)?;
        let solution = mdp::solve(&model)?;
        let decider = policy::decider(&model, &solution, solved, settings)?;
        let hold_epochs = (settings.hold_s * 1e3 / settings.epoch_ms).ceil() as u32;
        let mut supervisor = Self {
            decider,
            worth: Worth::new(solution, actions.len()),
            tree_hash: tree.hash(),
            tracker: Tracker::new(&model),
            silence: Silence::new(blind_after_misses),
            epoch_ns: (settings.epoch_ms * 1e6) as u64,
            gathered: EpochEvidence::new(),
            restraint: Restraint::new(hold_epochs),
            scratch: vec![0.0; states.len()],
            epoch_t_capture_ns: None,
            choice: Choice {
                action: 0,
                margin: 0.0,
                control: Control::Policy,
            },
            is_held: false,
            decided: None,
            decision_seq: 0,
            log_evidence: 0.0,
            impossible_count: 0,
            control_mode: ControlMode::Policy,
            run_id: 0,
            seen: Situation::default(),
            hold_epochs,
            model,
            states,
            actions,
            compensation,
        };
        supervisor.decide(false);
        Ok(supervisor)
    }

    /// See [`crate::Supervisor::step`].
    pub(crate) fn step(&mut self, entry: Entry<Inputs<'_>>, seen: Situation, action: &mut Action) {
        self.seen = seen;
        match entry {
            Entry::Frame(inputs) if seen.is_blind => self.take_blindly(inputs),
            Entry::Frame(inputs) => self.take(inputs),
            Entry::Missed(count) => self.miss(count),
            Entry::Reset => self.reset(),
            Entry::Budget(_) => {}
        }
        self.write(action);
    }

    /// The detector sees nothing: who is heard is known, what is said is not.
    fn take_blindly(&mut self, inputs: Inputs<'_>) {
        if inputs.diagnosis.is_some() {
            self.silence.diagnosis();
        }
        if inputs.detection.is_some() {
            self.silence.detection();
        }
        self.control_mode = ControlMode::Safe;
        self.gathered.forget();
    }

    /// The call for help that stands.
    pub(crate) const fn latched(&self) -> Option<usize> {
        self.restraint.called()
    }

    fn take(&mut self, inputs: Inputs<'_>) {
        let is_sound =
            |diagnosis: &FaultBelief| evidence::is_sound(diagnosis, &self.states, self.tree_hash);
        let diagnosis = inputs.diagnosis.filter(|diagnosis| is_sound(diagnosis));
        let detection = inputs.detection.filter(|d| d.p_fault.is_finite());
        let refused = u32::from(diagnosis.is_some() != inputs.diagnosis.is_some())
            + u32::from(detection.is_some() != inputs.detection.is_some());
        self.impossible_count = self.impossible_count.saturating_add(refused);
        if inputs.diagnosis.is_some() && diagnosis.is_none() {
            // An identifier that talks nonsense is as good as one that is silent.
            self.miss(1);
        }
        if detection.is_some() {
            self.silence.detection();
        }
        match (diagnosis, detection) {
            (Some(diagnosis), _) => {
                if self.silence.diagnosis() {
                    self.gathered.forget();
                }
                self.take_diagnosis(diagnosis);
            }
            (None, Some(detection)) if self.silence.identifier_is_lost() => {
                self.fall_back(detection);
            }
            _ => {}
        }
    }

    fn take_diagnosis(&mut self, diagnosis: &FaultBelief) {
        if diagnosis.run_id != self.run_id {
            self.reset();
            self.run_id = diagnosis.run_id;
        }
        let alarm = self.seen.alarm;
        let effect = self.gathered.add(diagnosis, &self.states, alarm);
        let timed = self.epoch_is_over(diagnosis.header.t_capture_ns);
        self.control_mode = ControlMode::Policy;
        if effect == Effect::Anchor {
            evidence::weights(diagnosis, &self.states, alarm, &mut self.scratch);
            self.tracker.anchor(&self.scratch);
            self.log_evidence = 0.0;
            self.decide(timed);
        } else if timed {
            self.tracker.predict(&self.model, self.choice.action);
            self.gathered.take(&mut self.scratch);
            match self.tracker.weigh(&self.scratch) {
                Evidence::Taken(p) => self.log_evidence = p.max(f64::MIN_POSITIVE).ln(),
                Evidence::Impossible => {
                    self.impossible_count = self.impossible_count.saturating_add(1);
                }
            }
            evidence::weights(diagnosis, &self.states, alarm, &mut self.scratch);
            if evidence::has_drifted(self.tracker.belief(), &self.scratch) {
                self.tracker.anchor(&self.scratch);
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

    /// The identifier is lost: the detector says how probable a fault is, the belief before the
    /// loss says which. Before an alarm its odds mean nothing.
    fn fall_back(&mut self, detection: &DetectionBelief) {
        let p_fault = match self.seen.alarm {
            true => detection.p_fault.clamp(0.0, 1.0),
            false => 0.0,
        };
        let belief = self.tracker.belief();
        let is_nominal = |meaning: &StateMeaning| meaning.node == Some(0);
        let faulty: f64 = belief
            .iter()
            .zip(&self.states)
            .filter(|(_, m)| !is_nominal(m))
            .map(|(b, _)| b)
            .sum();
        let others = self.states.iter().filter(|m| !is_nominal(m)).count() as f64;
        for ((weight, b), meaning) in self.scratch.iter_mut().zip(belief).zip(&self.states) {
            *weight = if is_nominal(meaning) {
                1.0 - p_fault
            } else if faulty > 0.0 {
                p_fault * b / faulty
            } else {
                p_fault / others
            };
        }
        self.tracker.anchor(&self.scratch);
        self.control_mode = ControlMode::Fallback;
        let timed = self.epoch_is_over(detection.header.t_capture_ns);
        self.decide(timed);
    }

    fn miss(&mut self, count: u32) {
        if self.silence.miss(count) {
            self.control_mode = ControlMode::Safe;
            self.gathered.forget();
        }
    }

    fn reset(&mut self) {
        self.tracker.reset();
        self.decider.reset();
        self.gathered.forget();
        self.restraint = Restraint::new(self.hold_epochs);
        self.epoch_t_capture_ns = None;
        self.log_evidence = 0.0;
        self.control_mode = ControlMode::Policy;
        self.decide(false);
    }

    fn decide(&mut self, timed: bool) {
        let best = self.decider.decide(self.tracker.belief()).choice();
        let values = self.worth.values(&self.decider, self.tracker.belief());
        let current = self.decided.map(|decided| decided.action);
        self.choice = self
            .restraint
            .decide(current, best, values, &self.actions, timed);
        self.is_held = current == Some(self.choice.action) && self.choice.action != best.action;
    }

    /// What the robot is told now.
    fn decided(&self) -> Instruction {
        if self.control_mode == ControlMode::Safe {
            return Instruction::stop(&self.actions, self.choice.action);
        }
        let action = self.choice.action;
        let kind = self
            .actions
            .get(action)
            .map_or(RecoveryKind::Stop, |m| m.kind);
        // The belief no longer speaks for a held action: it stands as it was.
        let held = self.decided.filter(|d| self.is_held && d.action == action);
        if let Some(held) = held {
            return held;
        }
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
        for (meaning, b) in self.states.iter().zip(self.tracker.belief()) {
            if meaning.wheel.is_some() && meaning.stuck == stuck && *b > best.1 {
                best = (meaning.wheel, *b);
            }
        }
        best.0
    }

    fn write(&mut self, action: &mut Action) {
        let decided = self.decided();
        if self.decided != Some(decided) {
            self.decided = Some(decided);
            self.decision_seq += 1;
        }
        let counter = decided
            .wheel
            .filter(|_| decided.kind == RecoveryKind::Compensate)
            .and_then(|wheel| self.compensation.iter().find(|c| c.wheel == wheel));
        action.run_id = self.run_id;
        action.decision_seq = self.decision_seq;
        action.curvature_gain = counter.map_or(1.0, |c| c.curvature_gain);
        action.curvature_offset = counter.map_or(0.0, |c| c.curvature_offset_1_m);
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
