//! Decisions about the leaves of the fault tree: the identifier's belief is the evidence.

use vigil_blocks::{Action, Carryover, ControlMode, DetectionBelief, FaultBelief};
use vigil_checkpoint::Checkpoint;
use vigil_pomdp::policy::Measure;
use vigil_pomdp::{Choice, Control};
use vigil_robot::{Description, FaultTree};

use crate::alarm_fusion::Situation;
use crate::decision_process::{DecisionProcess, DecisionRule, Instruction};
use crate::error::SupervisorError;
use crate::inputs::Inputs;
use crate::latch::{Latch, stands};
use crate::mapping::Compensation;
use crate::settings::Settings;
use crate::settling::{Settling, folded};
use crate::state_belief::{
    self, MOVED, distance, normalise, position, write_fallback, write_weights,
};
use crate::states::{self, StateMeaning, Subject};
use crate::switching_cost::SwitchingCost;
use crate::wheels::Wheels;

/// Tells when an epoch is over.
#[derive(Checkpoint)]
struct EpochClock {
    #[checkpoint(fixed)]
    epoch_ns: u64,
    /// Capture time at which the present epoch began.
    t_capture_ns: Option<u64>,
}

impl EpochClock {
    /// True once per epoch, by differences of the capture time; a jump back begins a new epoch.
    fn is_over(&mut self, t_capture_ns: u64) -> bool {
        let over = self.t_capture_ns.is_none_or(|began_ns| {
            t_capture_ns
                .checked_sub(began_ns)
                .is_none_or(|passed| passed >= self.epoch_ns)
        });
        if over {
            self.t_capture_ns = Some(t_capture_ns);
        }
        over
    }
}

/// Takes over the identifier's belief, tracks whether evidence still comes, and chooses actions.
#[derive(Checkpoint)]
pub(crate) struct FaultDecision {
    process: DecisionProcess,
    #[checkpoint(fixed)]
    tree_hash: u64,
    #[checkpoint(fixed)]
    states: Vec<StateMeaning>,
    wheels: Wheels,
    settling: Settling,
    epoch_clock: EpochClock,
    decision_t_capture_ns: Option<u64>,
    latch: Latch,
    switching: SwitchingCost,
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
        let (model, actions) = (&process.model, &process.actions);
        let states = states::states(model.states(), tree)?;
        let wheels = Wheels::new(model, actions, tree, robot, compensation)?;
        let mut rule = Self {
            process,
            tree_hash: tree.hash(),
            states,
            wheels,
            settling: Settling::new(&[]),
            epoch_clock: EpochClock {
                epoch_ns: (settings.epoch_ms * 1e6) as u64,
                t_capture_ns: None,
            },
            decision_t_capture_ns: None,
            latch: Latch::default(),
            switching: SwitchingCost::new(settings.switching_cost),
            instruction: None,
        };
        rule.begin();
        Ok(rule)
    }

    /// A run begins with nothing wrong, as the identifier's does. The model's own start is what its
    /// policy was solved for.
    fn begin(&mut self) {
        let nominal = position(&self.states, Subject::Nominal);
        for (state, weight) in self.process.scratch.iter_mut().enumerate() {
            *weight = f64::from(u8::from(Some(state) == nominal));
        }
        self.process.tracker.anchor(&self.process.scratch);
        self.wheels.forget();
        self.settling = Settling::new(&self.process.scratch);
        self.decision_t_capture_ns = None;
        self.switching.forget();
        let best = self.process.decider.decide(self.process.tracker.belief());
        self.choose(best.choice());
    }

    fn take_diagnosis(&mut self, diagnosis: &FaultBelief, situation: Situation) {
        self.begin_run(diagnosis.run_id);
        let t_capture_ns = diagnosis.header.t_capture_ns;
        let timed = self.pass_time(t_capture_ns);
        let process = &mut self.process;
        let before = process.tracker.belief();
        let weights = &mut process.scratch;
        let mut settling = self.settling;
        if situation.hearing.is_heard() {
            let answerable = self.wheels.answerable();
            let alarm = situation.alarm;
            write_weights(diagnosis, &self.states, answerable, alarm, weights);
            normalise(weights);
        } else {
            write_fallback(situation, &self.states, settling.held(), weights);
        }
        if timed {
            process.log_evidence = log_score(&folded(&self.states, before), weights);
        }
        // Of a robot that rests no evidence comes, and none ends; that of an identifier which is
        // not heard yet is still to come.
        if timed && !situation.rests && situation.hearing.is_heard() {
            settling.pass(&self.states, before);
        }
        settling.take(&self.states, weights);
        settling.write(&self.states, weights);
        let is_due = timed
            || process.control_mode != ControlMode::Policy
            || distance(before, weights) > MOVED
            || situation.hearing.is_heard() && self.wheels.have_moved(diagnosis);
        if !is_due {
            return;
        }
        let process = &mut self.process;
        process.control_mode = ControlMode::Policy;
        process.tracker.anchor(&process.scratch);
        self.settling = settling;
        if situation.hearing.is_heard() {
            self.wheels.take(diagnosis);
        }
        self.decide(t_capture_ns);
    }

    /// Predicts the belief at the end of an epoch; true if it has ended. A call is one step of the
    /// model, however long it takes: it ends with a reset. One that is put off is none.
    fn pass_time(&mut self, t_capture_ns: u64) -> bool {
        let is_over = self.epoch_clock.is_over(t_capture_ns);
        if is_over && self.latch.action().is_none() && !self.process.is_deferred {
            let process = &mut self.process;
            process
                .tracker
                .predict(&process.model, process.choice.action);
        }
        is_over
    }

    fn begin_run(&mut self, run_id: u64) {
        if run_id != self.process.run_id {
            self.reset();
            self.process.run_id = run_id;
        }
    }

    /// The identifier is lost.
    fn fall_back(&mut self, detection: &DetectionBelief, situation: Situation) {
        self.begin_run(detection.run_id);
        let t_capture_ns = detection.header.t_capture_ns;
        self.pass_time(t_capture_ns);
        let process = &mut self.process;
        let held = self.settling.held();
        write_fallback(situation, &self.states, held, &mut process.scratch);
        process.tracker.anchor(&process.scratch);
        process.control_mode = ControlMode::Fallback;
        process.log_evidence = 0.0;
        self.decide(t_capture_ns);
    }

    fn decide(&mut self, t_capture_ns: u64) {
        let before = self.decision_t_capture_ns.replace(t_capture_ns);
        let share = before.map_or(1.0, |before_ns| {
            let passed_ns = t_capture_ns.saturating_sub(before_ns);
            (passed_ns as f64 / self.epoch_clock.epoch_ns as f64).min(1.0)
        });
        let process = &mut self.process;
        let best = process.decider.decide(process.tracker.belief()).choice();
        let held = process.choice;
        // Nothing is held before the first decision. A step for information lasts as long as it is
        // asked for; what is deferred is not done.
        let is_free = before.is_none()
            || process.decider.measure() != Measure::Value
            || held.control == Control::Dual
            || process.is_deferred;
        if is_free {
            self.switching.forget();
            return self.choose(best);
        }
        let values = process.decider.values();
        let is_due = self
            .switching
            .is_due(held.action, best.action, values, share);
        self.choose(match is_due || best.action == held.action {
            true => best,
            false => stands(held.action),
        });
    }

    fn choose(&mut self, best: Choice) {
        self.process.choose(best, &mut self.latch, &mut self.wheels);
    }
}

/// How well a belief was predicted: the mean of the logarithm of the predicted probability, over
/// the belief. No more than 0; what was held impossible counts as 1e-12.
fn log_score(predicted: &[f64], belief: &[f64]) -> f64 {
    let score = |(predicted, b): (&f64, &f64)| b * predicted.clamp(1e-12, 1.0).ln();
    predicted.iter().zip(belief).map(score).sum()
}

impl DecisionRule for FaultDecision {
    fn take(&mut self, inputs: Inputs<'_>, situation: Situation) {
        let diagnosis = inputs.diagnosis.filter(|_| !situation.is_refused);
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
        let is_lost = diagnosis.is_none() && self.process.losses.identifier_is_lost();
        self.latch.keep_open(situation.forbids_latching(is_lost));
        let hearing = situation.hearing;
        match (diagnosis, detection) {
            // What was believed stands until it has a result.
            (Some(diagnosis), _)
                if hearing.is_late() || hearing.waits() && diagnosis.is_catching_up() =>
            {
                self.process.losses.diagnosis();
                self.begin_run(diagnosis.run_id);
            }
            (Some(diagnosis), _) if hearing.is_heard() || !hearing.may_latch() => {
                self.process.losses.diagnosis();
                self.take_diagnosis(diagnosis, situation);
            }
            // An identifier that is not waited for is as good as none.
            (Some(_), Some(detection)) => {
                self.process.losses.diagnosis();
                self.fall_back(detection, situation);
            }
            (None, Some(detection)) if is_lost => {
                self.fall_back(detection, situation);
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
    }

    fn miss(&mut self, count: u32) {
        if self.process.losses.miss(count) {
            self.process.control_mode = ControlMode::Safe;
        }
    }

    fn reset(&mut self) {
        self.process.reset();
        self.latch.release();
        self.epoch_clock.t_capture_ns = None;
        self.begin();
    }

    fn improve(&mut self) {
        self.process.improve();
    }

    fn restore(&mut self, left: &Carryover, believed: Option<&FaultBelief>) {
        let process = &mut self.process;
        process.restore(left, &mut self.latch);
        if let Some(believed) = believed {
            let answerable = self.wheels.answerable();
            write_weights(
                believed,
                &self.states,
                answerable,
                true,
                &mut process.scratch,
            );
            normalise(&mut process.scratch);
            process.tracker.anchor(&process.scratch);
            self.settling = Settling::new(&process.scratch);
            self.wheels.take(believed);
        }
    }

    fn is_sound(&self, diagnosis: &FaultBelief) -> bool {
        state_belief::is_sound(diagnosis, &self.states, self.tree_hash)
    }

    fn origin(&self) -> (u64, u64) {
        (self.process.run_id, self.process.model.hash())
    }

    fn latched(&self) -> Option<usize> {
        self.latch.action()
    }

    fn write(&mut self, action: &mut Action) {
        let instruction = self.process.instruction(&self.wheels);
        if self.instruction != Some(instruction) {
            self.instruction = Some(instruction);
            self.process.decision_seq += 1;
        }
        self.process.write(instruction, action);
        self.wheels.write(instruction.kind, action);
    }
}
