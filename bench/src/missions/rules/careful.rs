//! Look, remedy what is most probable, doubt, and call for help in the end.
//!
//! 1. Drive as planned while there is no alarm.
//! 2. At an alarm look for a while: standing, slowly, or driving on.
//! 3. Then do what the most probable explanation asks for, if it is probable enough: counter-steer
//!    against a stuck wheel, ignore a broken encoder, go on if nothing is wrong; else creep.
//! 4. If another explanation is the most probable for a while, begin again at 2; after so many
//!    looks, or so much creeping without an explanation, call for help and wait.
//! 5. As soon as there are several faults, answer all of them or call for help, if it is set to.
//!    Else it answers one.
//! 6. If the alarm has gone and nothing is wrong for a while, drive as planned.

use serde::{Deserialize, Serialize};
use vigil_blocks::RecoveryKind;

use super::{RuleInput, RuleOutput};
use crate::missions::breakdown::Cause;

/// What the rover does while the rule looks.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Looking {
    /// It stands.
    Stop,
    /// It goes slowly.
    SlowDown,
    /// It drives as planned.
    GoOn,
}

/// Pauses, thresholds and order.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CarefulSettings {
    /// What the rover does while the rule looks.
    pub looking: Looking,
    /// Time to look before a remedy, s.
    pub look_s: f64,
    /// Time for which another explanation must be the most probable before it counts, s.
    pub doubt_s: f64,
    /// Time of creeping without an explanation, s.
    pub creep_s: f64,
    /// Looks before help is called for.
    pub looks_max: u32,
    /// Least probability of an explanation to act on.
    pub p_min: f64,
    /// True to answer all of several faults with which the rover can be driven.
    pub limps_home: bool,
    /// True to call for help when there are several faults otherwise.
    pub calls_for_several: bool,
}

impl CarefulSettings {
    pub(super) const DIMENSIONS: usize = 8;

    pub(super) fn varied(self, dimension: usize) -> Vec<Self> {
        let looking = [Looking::Stop, Looking::SlowDown, Looking::GoOn];
        match dimension {
            0 => looking.map(|looking| Self { looking, ..self }).to_vec(),
            1 => [0.05, 0.1, 0.2, 0.4, 0.7, 1.0, 2.0]
                .map(|look_s| Self { look_s, ..self })
                .to_vec(),
            2 => [0.1, 0.3, 0.6, 1.0, 2.0]
                .map(|doubt_s| Self { doubt_s, ..self })
                .to_vec(),
            3 => [0.0, 0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0]
                .map(|creep_s| Self { creep_s, ..self })
                .to_vec(),
            4 => [1, 2, 3, 5, 10]
                .map(|looks_max| Self { looks_max, ..self })
                .to_vec(),
            5 => [0.0, 0.5, 0.8, 0.95]
                .map(|p_min| Self { p_min, ..self })
                .to_vec(),
            6 => [false, true]
                .map(|limps_home| Self { limps_home, ..self })
                .to_vec(),
            _ => [false, true]
                .map(|calls_for_several| Self {
                    calls_for_several,
                    ..self
                })
                .to_vec(),
        }
    }
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
    what: Option<Cause>,
    for_s: f64,
    doubt_s: f64,
}

/// The rule, one cycle at a time.
#[derive(Debug, Clone)]
pub struct Careful {
    settings: CarefulSettings,
    phase: Phase,
    looks: u32,
}

impl Careful {
    /// At the beginning.
    #[must_use]
    pub const fn new(settings: CarefulSettings) -> Self {
        Self {
            settings,
            phase: Phase::Driving,
            looks: 0,
        }
    }

    /// The rule's answer, `dt_s` after the last cycle.
    pub fn answer(&mut self, input: RuleInput, dt_s: f64) -> RuleOutput {
        let input = self.credible(input);
        let is_answered = input.several && self.settings.limps_home && self.phase != Phase::Waiting;
        if let Some(order) = input.limp_home.filter(|_| is_answered) {
            return order;
        }
        self.phase = match self.phase {
            _ if input.several && self.settings.calls_for_several => Phase::Waiting,
            Phase::Driving if input.alarm => self.look(),
            Phase::Looking { for_s } if for_s + dt_s < self.settings.look_s => Phase::Looking {
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

    /// What is not probable enough counts as not explained.
    fn credible(&self, mut input: RuleInput) -> RuleInput {
        if input.explanation.is_some() && input.p < self.settings.p_min {
            input.explanation = Some(Cause::Unmodelled);
        }
        input
    }

    fn look(&mut self) -> Phase {
        self.looks += 1;
        match self.looks > self.settings.looks_max {
            true => Phase::Waiting,
            false => Phase::Looking { for_s: 0.0 },
        }
    }

    fn remedy(&mut self, input: RuleInput, mut remedy: Remedy, dt_s: f64) -> Phase {
        let well = !input.alarm && input.explanation.is_none();
        remedy.for_s += dt_s;
        remedy.doubt_s = match well || input.explanation != remedy.what {
            true => remedy.doubt_s + dt_s,
            false => 0.0,
        };
        if remedy.doubt_s >= self.settings.doubt_s {
            return match well {
                true => Phase::Driving,
                false => self.look(),
            };
        }
        let creeps = remedy.what == Some(Cause::Unmodelled);
        match creeps && remedy.for_s >= self.settings.creep_s {
            true => Phase::Waiting,
            false => Phase::Remedying(remedy),
        }
    }

    fn output(&self) -> RuleOutput {
        match self.phase {
            Phase::Driving => RuleOutput::plain(RecoveryKind::GoOn),
            Phase::Waiting => RuleOutput::plain(RecoveryKind::CallForHelp),
            Phase::Looking { .. } => RuleOutput::plain(match self.settings.looking {
                Looking::Stop => RecoveryKind::Stop,
                Looking::SlowDown => RecoveryKind::SlowDown,
                Looking::GoOn => RecoveryKind::GoOn,
            }),
            Phase::Remedying(Remedy { what, .. }) => match what {
                Some(cause) => RuleOutput::remedy(cause),
                None => RuleOutput::plain(RecoveryKind::GoOn),
            },
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use Cause::{Encoder, Stuck, Unmodelled};
    use RecoveryKind::{CallForHelp, Compensate, GoOn, IgnoreEncoder, SlowDown, Stop};

    const SETTINGS: CarefulSettings = CarefulSettings {
        looking: Looking::Stop,
        look_s: 1.0,
        doubt_s: 1.0,
        creep_s: 2.0,
        looks_max: 2,
        p_min: 0.5,
        limps_home: true,
        calls_for_several: true,
    };

    /// What the rule says, without repetition, when each sight lasts so many tenths of a second.
    fn answers(sights: &[(bool, Option<Cause>, u32)]) -> Vec<(RecoveryKind, Option<usize>)> {
        let mut rule = Careful::new(SETTINGS);
        let mut said = Vec::new();
        for &(alarm, explanation, tenths) in sights {
            for _ in 0..tenths {
                let input = RuleInput {
                    alarm,
                    explanation,
                    p: 0.9,
                    several: false,
                    limp_home: None,
                };
                let output = rule.answer(input, 0.1);
                let wheel = output.wheels.wheels().next();
                if said.last() != Some(&(output.kind, wheel)) {
                    said.push((output.kind, wheel));
                }
            }
        }
        said
    }

    #[test]
    fn a_clear_diagnosis_is_remedied_after_one_look() {
        let said = answers(&[
            (false, None, 9),
            (true, Some(Unmodelled), 1),
            (true, Some(Stuck(4)), 50),
        ]);
        assert_eq!(said, [(GoOn, None), (Stop, None), (Compensate, Some(4))]);
        let said = answers(&[(true, Some(Encoder(2)), 50)]);
        assert_eq!(said, [(Stop, None), (IgnoreEncoder, Some(2))]);
    }

    #[test]
    fn what_nothing_explains_ends_with_a_call_for_help() {
        let said = answers(&[(true, Some(Unmodelled), 41), (true, Some(Stuck(1)), 90)]);
        assert_eq!(said, [(Stop, None), (SlowDown, None), (CallForHelp, None)]);
        // What is not probable enough explains nothing.
        let mut rule = Careful::new(SETTINGS);
        let unsure = RuleInput {
            alarm: true,
            explanation: Some(Stuck(1)),
            p: 0.4,
            several: false,
            limp_home: None,
        };
        let last = (0..40).map(|_| rule.answer(unsure, 0.1)).last().unwrap();
        assert_eq!(last.kind, CallForHelp);
        let several = RuleInput {
            several: true,
            ..unsure
        };
        assert_eq!(
            Careful::new(SETTINGS).answer(several, 0.1).kind,
            CallForHelp
        );
        let limping = RuleOutput::limp_home([Stuck(1), Encoder(2)]);
        let drivable = RuleInput {
            limp_home: limping,
            ..several
        };
        let answer = Careful::new(SETTINGS).answer(drivable, 0.1);
        assert_eq!(Some(answer), limping);
    }

    #[test]
    fn doubts_lead_to_another_look_and_then_to_help() {
        let said = answers(&[
            (true, Some(Stuck(0)), 15),
            (true, Some(Stuck(1)), 9),
            (true, Some(Stuck(0)), 5),
            (true, Some(Stuck(1)), 40),
            (true, Some(Stuck(0)), 40),
        ]);
        let first = [(Stop, None), (Compensate, Some(0)), (Stop, None)];
        let then = [(Compensate, Some(1)), (CallForHelp, None)];
        assert_eq!(said, [&first[..], &then[..]].concat());
    }

    #[test]
    fn a_false_alarm_that_goes_ends_in_driving() {
        let said = answers(&[(true, Some(Stuck(0)), 20), (false, None, 12)]);
        assert_eq!(said, [(Stop, None), (Compensate, Some(0)), (GoOn, None)]);
        // Nothing wrong though the alarm stands: as planned.
        assert_eq!(answers(&[(true, None, 30)]), [(Stop, None), (GoOn, None)]);
    }
}
