//! The baseline to beat: deterministic rules over the same detector and identifier.
//!
//! 1. Drive as planned while there is no alarm.
//! 2. At an alarm, stop, and look for [`LOOK_S`].
//! 3. Then do what the most probable explanation asks for: counter-steer against a stuck wheel,
//!    ignore a broken encoder, creep if nothing known explains it, go on if nothing is wrong.
//! 4. If for [`DOUBT_S`] another explanation is the most probable, begin again at 2; for the
//!    [`TRIALS_MAX`]th time, or after [`CREEP_S`] of creeping without an explanation, call for help
//!    and wait.
//! 5. If the alarm has gone and nothing is wrong for [`DOUBT_S`], drive as planned.

use vigil_blocks::RecoveryKind;

/// Time to look before a remedy, s: the identifier knows after 0.1 s in the median, and a rover
/// takes half a second to come to rest.
pub const LOOK_S: f64 = 1.0;
/// Time for which another explanation must be the most probable before it counts, s.
pub const DOUBT_S: f64 = 1.0;
/// Time of creeping without any explanation, s: as long as the supervisor restrains itself.
pub const CREEP_S: f64 = 2.0;
/// Stops before help is called for.
pub const TRIALS_MAX: u32 = 3;

/// Most probable explanation.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Explanation {
    /// Nothing is wrong.
    Nominal,
    /// This wheel is stuck.
    Stuck(usize),
    /// This wheel's encoder is broken.
    Encoder(usize),
    /// None that is known.
    Unknown,
}

/// What the rules see in one cycle.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RuleInput {
    /// The detector's alarm.
    pub alarm: bool,
    /// The identifier's most probable explanation.
    pub explanation: Explanation,
}

/// What the rules say.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct RuleOutput {
    /// Kind of action.
    pub kind: RecoveryKind,
    /// The wheel it is about.
    pub wheel: Option<usize>,
}

#[derive(Debug, Clone, Copy, PartialEq)]
enum Phase {
    Driving,
    Looking { for_s: f64 },
    Remedying(Remedy),
    Waiting,
}

/// What is being done about an explanation, and for how long it and doubt in it have lasted.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Remedy {
    what: Explanation,
    for_s: f64,
    doubt_s: f64,
}

/// The rules, one cycle at a time.
#[derive(Debug, Clone)]
pub struct Escalation {
    phase: Phase,
    trials: u32,
}

impl Default for Escalation {
    fn default() -> Self {
        Self {
            phase: Phase::Driving,
            trials: 0,
        }
    }
}

impl Escalation {
    /// The rules' answer, `dt_s` after the last cycle.
    pub fn answer(&mut self, input: RuleInput, dt_s: f64) -> RuleOutput {
        self.phase = match self.phase {
            Phase::Driving if input.alarm => self.stop(),
            Phase::Looking { for_s } if for_s + dt_s < LOOK_S => Phase::Looking {
                for_s: for_s + dt_s,
            },
            Phase::Looking { .. } => Phase::Remedying(Remedy {
                what: input.explanation,
                for_s: 0.0,
                doubt_s: 0.0,
            }),
            Phase::Remedying(remedy) => self.remedy(input, remedy, dt_s),
            Phase::Driving | Phase::Waiting => self.phase,
        };
        self.output()
    }

    fn stop(&mut self) -> Phase {
        self.trials += 1;
        match self.trials >= TRIALS_MAX {
            true => Phase::Waiting,
            false => Phase::Looking { for_s: 0.0 },
        }
    }

    fn remedy(&mut self, input: RuleInput, mut remedy: Remedy, dt_s: f64) -> Phase {
        let well = !input.alarm && input.explanation == Explanation::Nominal;
        remedy.for_s += dt_s;
        remedy.doubt_s = match well || input.explanation != remedy.what {
            true => remedy.doubt_s + dt_s,
            false => 0.0,
        };
        if remedy.doubt_s >= DOUBT_S {
            return match well {
                true => Phase::Driving,
                false => self.stop(),
            };
        }
        if remedy.what == Explanation::Unknown && remedy.for_s >= CREEP_S {
            return Phase::Waiting;
        }
        Phase::Remedying(remedy)
    }

    const fn output(&self) -> RuleOutput {
        let (kind, wheel) = match self.phase {
            Phase::Driving => (RecoveryKind::GoOn, None),
            Phase::Looking { .. } => (RecoveryKind::Stop, None),
            Phase::Waiting => (RecoveryKind::CallForHelp, None),
            Phase::Remedying(Remedy { what, .. }) => match what {
                Explanation::Nominal => (RecoveryKind::GoOn, None),
                Explanation::Stuck(wheel) => (RecoveryKind::Compensate, Some(wheel)),
                Explanation::Encoder(wheel) => (RecoveryKind::IgnoreEncoder, Some(wheel)),
                Explanation::Unknown => (RecoveryKind::SlowDown, None),
            },
        };
        RuleOutput { kind, wheel }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use Explanation::{Encoder, Nominal, Stuck, Unknown};
    use RecoveryKind::{CallForHelp, Compensate, GoOn, IgnoreEncoder, SlowDown, Stop};

    /// What the rules say, without repetition, when each sight lasts so many tenths of a second.
    fn answers(sights: &[(bool, Explanation, u32)]) -> Vec<(RecoveryKind, Option<usize>)> {
        let mut rules = Escalation::default();
        let mut said = Vec::new();
        for &(alarm, explanation, tenths) in sights {
            for _ in 0..tenths {
                let output = rules.answer(RuleInput { alarm, explanation }, 0.1);
                if said.last() != Some(&(output.kind, output.wheel)) {
                    said.push((output.kind, output.wheel));
                }
            }
        }
        said
    }

    #[test]
    fn a_clear_diagnosis_is_remedied_after_one_stop() {
        let said = answers(&[
            (false, Nominal, 9),
            (true, Unknown, 1),
            (true, Stuck(4), 50),
        ]);
        assert_eq!(said, [(GoOn, None), (Stop, None), (Compensate, Some(4))]);
        let said = answers(&[(true, Encoder(2), 50)]);
        assert_eq!(said, [(Stop, None), (IgnoreEncoder, Some(2))]);
    }

    #[test]
    fn what_nothing_explains_ends_with_a_call_for_help() {
        let said = answers(&[
            (true, Unknown, 11),
            (true, Unknown, 30),
            (true, Stuck(1), 90),
        ]);
        assert_eq!(said, [(Stop, None), (SlowDown, None), (CallForHelp, None)]);
    }

    #[test]
    fn doubts_lead_to_another_look_and_then_to_help() {
        let said = answers(&[
            (true, Stuck(0), 15),
            (true, Stuck(1), 9),
            (true, Stuck(0), 5),
            (true, Stuck(1), 40),
            (true, Stuck(0), 40),
        ]);
        let first = [(Stop, None), (Compensate, Some(0)), (Stop, None)];
        let then = [(Compensate, Some(1)), (CallForHelp, None)];
        assert_eq!(said, [&first[..], &then[..]].concat());
    }

    #[test]
    fn a_false_alarm_that_goes_ends_in_driving() {
        let said = answers(&[(true, Stuck(0), 20), (false, Nominal, 12)]);
        assert_eq!(said, [(Stop, None), (Compensate, Some(0)), (GoOn, None)]);
        // Nothing wrong though the alarm stands: as planned.
        assert_eq!(
            answers(&[(true, Nominal, 30)]),
            [(Stop, None), (GoOn, None)]
        );
    }
}
