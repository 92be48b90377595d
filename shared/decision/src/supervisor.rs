//! One decision cycle.

use vigil_blocks::{Action, Carryover, Entry, FaultBelief};
use vigil_checkpoint::Checkpoint;
use vigil_pomdp::{PointBased, Pomdp};
use vigil_robot::{Description, FaultTree};

use crate::alarm_fusion::AlarmFusion;
use crate::decision_process::{DecisionProcess, DecisionRule};
use crate::error::SupervisorError;
use crate::fault_decision::FaultDecision;
use crate::inputs::Inputs;
use crate::mapping::Compensation;
use crate::policy;
use crate::settings::{self, Settings};
use crate::symptom_decision::SymptomDecision;

/// Tracks the belief of the recovery POMDP and chooses actions.
#[derive(Checkpoint)]
pub struct Supervisor {
    fusion: AlarmFusion,
    rule: Box<dyn DecisionRule>,
    /// Of the last cycle.
    decision_seq: u64,
}

impl Supervisor {
    /// Builds a supervisor for a decision model. With `settings.evidence` of faults, its states are
    /// leaves, nodes or kinds of `tree`; of symptoms, its observations are sets of them. `solved`
    /// is what the policy `point-based` decides by; the others do without. After
    /// `blind_after_misses` misses in a row without any detection no belief is usable, and the
    /// robot stops.
    ///
    /// # Errors
    /// [`SupervisorError`] naming what does not fit.
    pub fn new(
        model: Pomdp,
        solved: Option<&PointBased>,
        tree: &FaultTree,
        robot: &Description,
        settings: &Settings,
        compensation: Vec<Compensation>,
        blind_after_misses: u32,
    ) -> Result<Self, SupervisorError> {
        let by_symptoms = matches!(settings.evidence, settings::Evidence::Symptoms);
        let shown = solved
            .filter(|_| by_symptoms)
            .map(|solved| policy::with_identifier(solved, &model, tree, settings))
            .transpose()?;
        let solved = shown.as_ref().or(solved);
        let process = DecisionProcess::new(model, solved, settings, blind_after_misses)?;
        let rule: Box<dyn DecisionRule> = match settings.evidence {
            settings::Evidence::Faults => {
                let rule = FaultDecision::new(process, tree, robot, settings, compensation)?;
                Box::new(rule)
            }
            settings::Evidence::Symptoms => {
                let rule = SymptomDecision::new(process, tree, robot, settings, compensation)?;
                Box::new(rule)
            }
        };
        Ok(Self {
            fusion: AlarmFusion::new(settings.arming_speed_scale),
            rule,
            decision_seq: 0,
        })
    }

    /// Takes one journal entry and writes the decision. On misses belief and decision stand, until
    /// every stage is lost; a diagnosis that is late is taken when it comes. While the detector is
    /// blind the robot stops, and beliefs stand. Input that is not a probability, or of another
    /// fault tree, is counted in `impossible_count` and refused; a refused diagnosis counts as
    /// missed. Every field of `action` is written but the header's epoch, sequence number and
    /// times, the cause and `valid_until_ns`: those belong to the ports. Allocates nothing, never
    /// panics on any input; no field is ever NaN.
    // Never merged into its caller, so that its instructions can be counted.
    #[inline(never)]
    pub fn step(&mut self, entry: Entry<Inputs<'_>>, action: &mut Action) {
        let is_sound = |it: &FaultBelief| self.rule.is_sound(it);
        let entry = self.fusion.take(entry, is_sound);
        let situation = self.fusion.situation();
        let is_frame = matches!(entry, Entry::Frame(_));
        match entry {
            Entry::Frame(inputs) if situation.is_blind => self.rule.take_blindly(inputs),
            Entry::Frame(inputs) => self.rule.take(inputs, situation),
            Entry::Missed(count) => self.rule.miss(count),
            Entry::Reset => self.rule.reset(),
            Entry::Budget(_) => {}
        }
        self.rule.write(action);
        self.fusion.write(action);
        assert!(
            action.decision_seq >= self.decision_seq,
            "the number of a decision never falls: {} after {}",
            action.decision_seq,
            self.decision_seq
        );
        self.decision_seq = action.decision_seq;
        if is_frame {
            self.rule.improve();
        }
    }

    /// Goes on from what an earlier supervisor of the same graph has left, and what it told of.
    pub fn restore(&mut self, left: &Carryover, believed: Option<&FaultBelief>) {
        self.fusion.restore(left);
        // What was believed is of use beside an alarm of the detector.
        let believed = believed.filter(|_| left.detected_t_capture_ns != 0);
        let believed = believed.filter(|it| self.rule.is_sound(it));
        self.rule.restore(left, believed);
    }

    /// What a supervisor that replaces this one goes on from.
    #[must_use]
    pub fn carryover(&self) -> Carryover {
        let (run_id, model_hash) = self.rule.origin();
        let latched = self.rule.latched();
        Carryover {
            run_id,
            model_hash,
            latched: latched.map_or(0, |action| action as u32 + 1),
            ..self.fusion.carryover()
        }
    }

    /// False while the identifier knows nothing yet of an alarm that stands.
    #[must_use]
    pub fn hears_identifier(&self) -> bool {
        self.fusion.situation().hearing.is_heard()
    }

    /// The action that stands whatever is believed: a call for help, or the end of the task. It
    /// stands until a new run or a reset.
    #[must_use]
    pub fn latched(&self) -> Option<usize> {
        self.rule.latched()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::alarm_fusion::Situation;

    /// Publishes the number that it is given.
    #[derive(Checkpoint)]
    struct Numbered(u64);

    impl DecisionRule for Numbered {
        fn take(&mut self, _: Inputs<'_>, _: Situation) {}
        fn take_blindly(&mut self, _: Inputs<'_>) {}
        fn miss(&mut self, count: u32) {
            self.0 = u64::from(count);
        }
        fn reset(&mut self) {}
        fn restore(&mut self, _: &Carryover, _: Option<&FaultBelief>) {}
        fn is_sound(&self, _: &FaultBelief) -> bool {
            true
        }
        fn origin(&self) -> (u64, u64) {
            (0, 0)
        }
        fn latched(&self) -> Option<usize> {
            None
        }
        fn write(&mut self, action: &mut Action) {
            action.decision_seq = self.0;
        }
        fn improve(&mut self) {}
    }

    #[test]
    #[should_panic(expected = "the number of a decision never falls: 6 after 7")]
    fn a_number_that_falls_is_caught() {
        let mut supervisor = Supervisor {
            fusion: AlarmFusion::new(1.0),
            rule: Box::new(Numbered(0)),
            decision_seq: 0,
        };
        let mut action = Action::default();
        for count in [7, 7, 6] {
            supervisor.step(Entry::Missed(count), &mut action);
        }
    }
}
