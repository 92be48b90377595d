//! What decisions by either kind of evidence share: the tracked belief, the policy, the present
//! choice, and how they are published.

use vigil_blocks::{
    Action, AnsweredWheels, Carryover, ControlMode, DECISION_ACTIONS, DECISION_STATES, FaultBelief,
    RecoveryKind, ValueKind,
};
use vigil_checkpoint::{Checkpoint, CheckpointValue};
use vigil_pomdp::policy::Measure;
use vigil_pomdp::{Choice, Control, Decider, Evidence, PointBased, Pomdp, Tracker, mdp};

use crate::alarm_fusion::Situation;
use crate::error::SupervisorError;
use crate::inputs::Inputs;
use crate::kept;
use crate::latch::{Latch, latches, stands};
use crate::mapping::{self, ActionMeaning};
use crate::policy;
use crate::settings::Settings;
use crate::stage_loss::StageLossMonitor;
use crate::wheels::Wheels;

/// A published belief sums to 1 within this: the tracker's tolerance.
const SUM_TOLERANCE: f64 = 1e-9;

/// How one kind of evidence becomes a decision.
pub(crate) trait DecisionRule: Checkpoint {
    /// Takes what the stages publish while the detector is not blind.
    fn take(&mut self, inputs: Inputs<'_>, situation: Situation);

    /// Takes what the stages publish while the detector is blind: that they live counts, what they
    /// say does not.
    fn take_blindly(&mut self, inputs: Inputs<'_>);

    /// More missed cycles.
    fn miss(&mut self, count: u32);

    /// Everything begins anew.
    fn reset(&mut self);

    /// Goes on in the run of an earlier supervisor. `believed` is what that told of beside the
    /// detector's alarm, and is sound.
    fn restore(&mut self, left: &Carryover, believed: Option<&FaultBelief>);

    /// True of a diagnosis that can be used.
    fn is_sound(&self, diagnosis: &FaultBelief) -> bool;

    /// The run that is decided about, and the hash of the model.
    fn origin(&self) -> (u64, u64);

    /// The action that stands whatever is believed.
    fn latched(&self) -> Option<usize>;

    /// Writes the decision, and counts it if it is a new one.
    fn write(&mut self, action: &mut Action);

    /// Spends a share of spare time on the belief that stands.
    fn improve(&mut self);
}

/// What the robot is to do; a change of it is a new decision.
#[derive(Debug, Clone, Copy, PartialEq, CheckpointValue)]
pub(crate) struct Instruction {
    pub action: usize,
    pub kind: RecoveryKind,
    pub wheels: AnsweredWheels,
}

/// A step of the decision model.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, CheckpointValue)]
pub(crate) struct Step {
    /// `belief_count` when it was made.
    pub belief: u64,
    pub action: usize,
    /// `None` for what the model cannot observe.
    pub observation: Option<usize>,
}

/// A decision model with its belief, policy and present choice.
#[derive(Checkpoint)]
pub(crate) struct DecisionProcess {
    #[checkpoint(fixed)]
    pub model: Pomdp,
    #[checkpoint(with = kept::tracker)]
    pub tracker: Tracker,
    #[checkpoint(with = kept::decider)]
    pub decider: Decider,
    #[checkpoint(fixed)]
    pub actions: Vec<ActionMeaning>,
    pub losses: StageLossMonitor,
    /// One number per state, of no meaning between two uses.
    #[checkpoint(fixed)]
    pub scratch: Vec<f64>,
    #[checkpoint(with = kept::choice)]
    pub choice: Choice,
    pub decision_seq: u64,
    pub log_evidence: f64,
    pub impossible_count: u32,
    /// Counts beliefs that began anew.
    pub belief_count: u64,
    /// Steps of the model, and the last one.
    pub step_count: u64,
    pub step: Step,
    pub control_mode: ControlMode,
    /// The choice is not to be latched at present: the robot creeps instead.
    pub is_deferred: bool,
    pub run_id: u64,
}

impl DecisionProcess {
    /// # Errors
    /// [`SupervisorError`] naming what does not fit.
    pub(crate) fn new(
        model: Pomdp,
        solved: Option<&PointBased>,
        settings: &Settings,
        blind_after_misses: u32,
    ) -> Result<Self, SupervisorError> {
        mapping::check_size(&model)?;
        let actions = mapping::actions(&model, &settings.actions)?;
        let solution = mdp::solve(&model)?;
        Ok(Self {
            decider: policy::decider(&model, &solution, solved, settings)?,
            tracker: Tracker::new(&model),
            losses: StageLossMonitor::new(blind_after_misses),
            scratch: vec![0.0; model.states().len()],
            choice: stands(0),
            decision_seq: 0,
            log_evidence: 0.0,
            impossible_count: 0,
            belief_count: 0,
            step_count: 0,
            step: Step::default(),
            control_mode: ControlMode::Policy,
            is_deferred: false,
            run_id: 0,
            model,
            actions,
        })
    }

    /// Belief, policy and mode as at the start; counters go on.
    pub(crate) fn reset(&mut self) {
        self.tracker.reset();
        self.decider.reset();
        self.belief_count += 1;
        self.log_evidence = 0.0;
        self.control_mode = ControlMode::Policy;
    }

    /// Spends a share of spare time on the belief that stands: the next decision may be a better
    /// one.
    pub(crate) fn improve(&mut self) {
        self.decider.improve(self.tracker.belief());
    }

    /// Counts input that cannot be.
    pub(crate) const fn refuse(&mut self) {
        self.impossible_count = self.impossible_count.saturating_add(1);
    }

    /// The logarithm of the evidence's probability; what is impossible is counted and has none.
    pub(crate) fn log_probability(&mut self, evidence: Evidence) -> Option<f64> {
        match evidence {
            Evidence::Taken(p) => Some(p.max(f64::MIN_POSITIVE).ln()),
            Evidence::Impossible => {
                self.refuse();
                None
            }
        }
    }

    /// What an action makes the robot do.
    pub(crate) fn kind(&self, action: usize) -> RecoveryKind {
        self.actions
            .get(action)
            .map_or(RecoveryKind::Stop, |m| m.kind)
    }

    /// Goes on in the run of an earlier supervisor. What stood for the same model stands on; beside
    /// that or an alarm, the robot stands until something is heard.
    pub(crate) fn restore(&mut self, left: &Carryover, latch: &mut Latch) {
        self.run_id = left.run_id;
        let latched = left.latched().filter(|it| latches(self.kind(*it)));
        let latched = latched.filter(|_| left.model_hash == self.model.hash());
        if let Some(action) = latched {
            latch.restore(action);
            self.choice = stands(action);
        }
        if latched.is_some() || left.detected_t_capture_ns != 0 {
            self.control_mode = ControlMode::Safe;
        }
    }

    /// Takes over the policy's choice, unless another action is latched, and the wheels that it is
    /// about.
    pub(crate) fn choose(&mut self, best: Choice, latch: &mut Latch, wheels: &mut Wheels) {
        let choice = latch.choose(best, |action| self.kind(action));
        let before = std::mem::replace(&mut self.choice, choice).action;
        self.is_deferred = latch.action().is_none() && latches(self.kind(choice.action));
        wheels.choose(self.kind(choice.action), choice.action == before);
    }

    /// What the present choice makes the robot do; in the safe mode it stops.
    pub(crate) fn instruction(&self, wheels: &Wheels) -> Instruction {
        if self.control_mode == ControlMode::Safe {
            return self.safe_stop();
        }
        if self.is_deferred {
            return self.creep();
        }
        let (action, wheels) = (self.choice.action, wheels.about());
        let kind = match self.kind(action) {
            // Whoever does not know what is broken cannot drive with it.
            RecoveryKind::LimpHome if wheels.is_empty() => RecoveryKind::Stop,
            kind => kind,
        };
        Instruction {
            action,
            kind,
            wheels,
        }
    }

    /// The action that the robot does of its own choice.
    pub(crate) fn done(&self) -> usize {
        match self.is_deferred {
            true => self.creep().action,
            false => self.choice.action,
        }
    }

    /// Evidence is to come as long as a call for help is put off; a model without such an action
    /// stops.
    fn creep(&self) -> Instruction {
        let is_slow = |m: &ActionMeaning| m.kind == RecoveryKind::SlowDown;
        let slow_down = self.actions.iter().position(is_slow);
        slow_down.map_or_else(
            || self.safe_stop(),
            |action| Instruction {
                action,
                kind: RecoveryKind::SlowDown,
                wheels: AnsweredWheels::default(),
            },
        )
    }

    /// The stop of a safe mode: the model's action of that kind, if it has one, else the present
    /// action's index.
    fn safe_stop(&self) -> Instruction {
        let is_stop = |m: &ActionMeaning| m.kind == RecoveryKind::Stop;
        let stop = self.actions.iter().position(is_stop);
        Instruction {
            action: stop.unwrap_or(self.choice.action),
            kind: RecoveryKind::Stop,
            wheels: AnsweredWheels::default(),
        }
    }

    /// Writes belief, values and decision into the block.
    pub(crate) fn write(&self, instruction: Instruction, action: &mut Action) {
        let values = self.decider.values();
        let belief = self.tracker.belief();
        let stops = instruction.kind == RecoveryKind::Stop;
        let meaning = self.actions.get(instruction.action);
        action.run_id = self.run_id;
        action.decision_seq = self.decision_seq;
        action.curvature_gain = 1.0;
        action.curvature_offset = 0.0;
        action.log_evidence = self.log_evidence;
        action.impossible_count = self.impossible_count;
        action.step_belief = self.step.belief;
        action.step_count = self.step_count;
        action.step_action = self.step.action as u32;
        action.step_observation = self.step.observation.map_or(u32::MAX, |z| z as u32);
        action.lost_stages = self.losses.lost_stages();
        action.model_hash = self.model.hash();
        action.belief = [0.0; DECISION_STATES];
        action.value = [0.0; DECISION_ACTIONS];
        action.belief[..belief.len()].copy_from_slice(belief);
        action.value[..values.len()].copy_from_slice(values);
        action.entropy = self.tracker.entropy();
        action.action_entropy = self.decider.action_entropy();
        action.value_kind = match self.decider.measure() {
            Measure::Value => ValueKind::Value,
            Measure::Votes => ValueKind::Votes,
            Measure::Entropy => ValueKind::Entropy,
        } as u32;
        action.margin = self.choice.margin;
        // A stop stands whatever its action's scale is. An action of no known meaning stands too.
        action.speed_scale = meaning.map_or(0.0, |m| if stops { 0.0 } else { m.speed_scale });
        action.action = instruction.action as u32;
        action.kind = instruction.kind as u32;
        action.answer(instruction.wheels);
        action.control_mode = self.published_mode() as u32;
        action.state_count = belief.len() as u32;
        action.action_count = values.len() as u32;
        assert_sound(action);
    }

    /// Dual control is a way to use a belief with fresh evidence: in other modes it goes unnamed.
    fn published_mode(&self) -> ControlMode {
        match (self.control_mode, self.choice.control) {
            (ControlMode::Policy, Control::Dual) => ControlMode::Dual,
            (mode, _) => mode,
        }
    }
}

/// What the robot's side relies on.
fn assert_sound(action: &Action) {
    let sum: f64 = action.belief.iter().sum();
    assert!(
        (sum - 1.0).abs() <= SUM_TOLERANCE && action.belief.iter().all(|b| *b >= 0.0),
        "a published belief sums to 1 and holds no negative number: {sum}"
    );
    assert!(
        action.action < action.action_count,
        "the action published is one of the model's: {}",
        action.action
    );
    assert!(
        action.control_mode != ControlMode::Safe as u32
            || (action.kind == RecoveryKind::Stop as u32 && action.speed_scale == 0.0),
        "in the safe mode the robot stops"
    );
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sound() -> Action {
        let mut action = Action {
            action_count: 2,
            state_count: 2,
            ..Action::default()
        };
        action.belief[..2].copy_from_slice(&[0.25, 0.75]);
        assert_sound(&action);
        action
    }

    #[test]
    #[should_panic(expected = "a published belief sums to 1 and holds no negative number: 1.25")]
    fn a_published_belief_that_does_not_sum_to_one_is_caught() {
        let mut action = sound();
        action.belief[0] = 0.5;
        assert_sound(&action);
    }

    #[test]
    #[should_panic(expected = "a published belief sums to 1 and holds no negative number: 1")]
    fn a_published_belief_with_a_negative_number_is_caught() {
        let mut action = sound();
        action.belief[..2].copy_from_slice(&[-0.5, 1.5]);
        assert_sound(&action);
    }

    /// A process of the tests' decision model.
    fn process() -> DecisionProcess {
        let settings = include_str!("../tests/decision/world/by_hand.toml");
        let settings: Settings = toml::from_str(settings).unwrap();
        let model = include_str!("../tests/decision/world/by_hand.pomdp");
        let model = Pomdp::parse(model).unwrap();
        DecisionProcess::new(model, None, &settings, 3).unwrap()
    }

    /// Writes the stop, and then the stop as `changed`.
    fn write_changed(process: &DecisionProcess, changed: impl FnOnce(Instruction) -> Instruction) {
        let (stop, mut action) = (process.safe_stop(), Action::default());
        process.write(stop, &mut action);
        assert_eq!(
            (action.action as usize, action.speed_scale),
            (stop.action, 0.0)
        );
        process.write(changed(stop), &mut action);
    }

    #[test]
    #[should_panic(expected = "the action published is one of the model's: 99")]
    fn an_action_that_the_model_lacks_is_caught() {
        write_changed(&process(), |stop| Instruction { action: 99, ..stop });
    }

    #[test]
    #[should_panic(expected = "in the safe mode the robot stops")]
    fn a_safe_mode_without_a_stop_is_caught() {
        let mut process = process();
        process.control_mode = ControlMode::Safe;
        write_changed(&process, |_| Instruction {
            action: 0,
            kind: RecoveryKind::GoOn,
            wheels: AnsweredWheels::default(),
        });
    }
}
