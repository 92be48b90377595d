//! The rule to beat: an escalation ladder, as navigation stacks have it, over the same monitors,
//! detector and identifier.
//!
//! 1. Follow the path while no monitor has a symptom.
//! 2. When one stands for a while, climb a rung: look for an opening, plan a new path, move away,
//!    find the own place, in the order of the settings; a lost robot may do the last one first.
//! 3. A rung that failed is followed by the next at once. After one that was done the robot follows
//!    its path, and climbs on if a symptom then still stands.
//! 4. After the last rung of the last round, call for help. Without symptoms for a while, begin at
//!    the foot again.
//!
//! What the identifier names with enough probability is answered meanwhile: counter-steer, or
//! ignore the encoder, on every rung. What it cannot name for a while is a call for help.

use serde::{Deserialize, Serialize};
use vigil_blocks::{ActionOutcome, AnsweredWheels, RecoveryKind, Symptoms};

use crate::missions::{Cause, RuleInput, RuleOutput};

/// A rung is left after this long, s, if no outcome comes.
const RUNG_MAX_S: f64 = 30.0;

/// What is tried.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Rung {
    /// Look for an opening, and go through.
    GoThrough,
    /// Plan a new path.
    NewPath,
    /// Move away from the present place.
    MoveAway,
    /// Find the own place.
    Relocalise,
}

impl Rung {
    const ALL: [Self; 4] = [
        Self::GoThrough,
        Self::NewPath,
        Self::MoveAway,
        Self::Relocalise,
    ];

    const fn kind(self) -> RecoveryKind {
        match self {
            Self::GoThrough => RecoveryKind::GoThrough,
            Self::NewPath => RecoveryKind::NewPath,
            Self::MoveAway => RecoveryKind::MoveAway,
            Self::Relocalise => RecoveryKind::Relocalise,
        }
    }
}

/// Pauses, thresholds and order.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct EscalationSettings {
    /// Time for which a symptom must stand before the first rung, s.
    pub wait_s: f64,
    /// Order of the rungs.
    pub order: [Rung; 4],
    /// How many of them are climbed.
    pub rungs: usize,
    /// How many times.
    pub rounds: usize,
    /// Time after a rung in which symptoms may go, s.
    pub settle_s: f64,
    /// Time without a symptom after which the ladder begins anew, s.
    pub quiet_s: f64,
    /// True if a robot in doubt of its place finds it first.
    pub finds_its_place_first: bool,
    /// Least probability of a fault to be answered; above 1 none is.
    pub p_min: f64,
    /// Time for which an alarm without a name must stand before a call for help, s.
    pub unknown_s: f64,
}

impl EscalationSettings {
    /// Settings that can be varied.
    pub const DIMENSIONS: usize = 9;

    /// The ladder with each value that one of its settings may have.
    #[must_use]
    pub fn varied(self, dimension: usize) -> Vec<Self> {
        match dimension {
            0 => [0.0, 0.3, 1.0, 3.0, 10.0, 30.0]
                .map(|wait_s| Self { wait_s, ..self })
                .to_vec(),
            1 => orders().map(|order| Self { order, ..self }).collect(),
            2 => [1, 2, 3, 4].map(|rungs| Self { rungs, ..self }).to_vec(),
            3 => [1, 2, 3].map(|rounds| Self { rounds, ..self }).to_vec(),
            4 => [0.3, 1.0, 3.0, 8.0, 15.0]
                .map(|settle_s| Self { settle_s, ..self })
                .to_vec(),
            5 => [0.3, 2.0, 5.0, 20.0]
                .map(|quiet_s| Self { quiet_s, ..self })
                .to_vec(),
            6 => [false, true]
                .map(|finds_its_place_first| Self {
                    finds_its_place_first,
                    ..self
                })
                .to_vec(),
            7 => [0.3, 0.5, 0.8, 0.95, 2.0]
                .map(|p_min| Self { p_min, ..self })
                .to_vec(),
            _ => [0.3, 1.0, 3.0, 10.0, 30.0, 1000.0]
                .map(|unknown_s| Self { unknown_s, ..self })
                .to_vec(),
        }
    }
}

/// Every order of the four rungs.
fn orders() -> impl Iterator<Item = [Rung; 4]> {
    let all = Rung::ALL;
    (0..256).filter_map(move |code: usize| {
        let order = [code % 4, code / 4 % 4, code / 16 % 4, code / 64];
        let is_order = (0..4).all(|rung| order.contains(&rung));
        is_order.then(|| order.map(|rung| all[rung]))
    })
}

/// What the ladder sees in one cycle.
#[derive(Debug, Clone, Copy)]
pub(super) struct LadderInput {
    /// Symptoms of the monitors that stand.
    pub symptoms: u32,
    /// Outcome of the last order.
    pub outcome: ActionOutcome,
    /// Alarm and explanation.
    pub hardware: RuleInput,
}

#[derive(Debug, Clone, Copy, PartialEq)]
enum Phase {
    /// Follows the path; for how long a symptom has stood, s.
    Following { troubled_s: f64 },
    /// On a rung, for how long, s.
    Climbing { kind: RecoveryKind, for_s: f64 },
    /// Help is called for.
    Calling,
}

/// What the ladder orders.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct LadderOrder {
    /// What to do, and against which wheel.
    pub output: RuleOutput,
    /// Rises when it is to be done anew.
    pub number: u64,
}

/// The ladder, one cycle at a time.
#[derive(Debug, Clone)]
pub(super) struct Escalation {
    settings: EscalationSettings,
    phase: Phase,
    /// Rungs that were climbed since the foot.
    climbed: usize,
    quiet_s: f64,
    nameless_s: f64,
    /// Time since a rung was done, s.
    since_rung_s: f64,
    found_its_place: bool,
    number: u64,
    last: Option<RuleOutput>,
}

impl Escalation {
    pub(super) const fn new(settings: EscalationSettings) -> Self {
        Self {
            settings,
            phase: Phase::Following { troubled_s: 0.0 },
            climbed: 0,
            quiet_s: 0.0,
            nameless_s: 0.0,
            since_rung_s: f64::INFINITY,
            found_its_place: false,
            number: 0,
            last: None,
        }
    }

    /// The ladder's order, `dt_s` after the last cycle.
    pub(super) fn order(&mut self, input: LadderInput, dt_s: f64) -> LadderOrder {
        let before = self.phase;
        self.phase = self.next_phase(input, dt_s);
        // The same rung may be climbed twice in a row.
        let climbs = |phase| matches!(phase, Phase::Climbing { .. });
        let is_new =
            climbs(before) && matches!(self.phase, Phase::Climbing { for_s, .. } if for_s == 0.0);
        let output = self.output(input.hardware);
        if is_new || self.last != Some(output) {
            (self.number, self.last) = (self.number + 1, Some(output));
        }
        LadderOrder {
            output,
            number: self.number,
        }
    }

    fn next_phase(&mut self, input: LadderInput, dt_s: f64) -> Phase {
        let is_troubled = input.symptoms != 0;
        let quiet_s = if is_troubled {
            0.0
        } else {
            self.quiet_s + dt_s
        };
        self.quiet_s = quiet_s;
        self.since_rung_s += dt_s;
        self.nameless_s = match self.is_nameless(input.hardware) {
            true => self.nameless_s + dt_s,
            false => 0.0,
        };
        let ended = matches!(
            input.outcome,
            ActionOutcome::Succeeded | ActionOutcome::Failed
        );
        match self.phase {
            Phase::Calling if ended => {
                *self = Self {
                    number: self.number,
                    last: self.last,
                    ..Self::new(self.settings)
                };
                self.phase
            }
            Phase::Calling => Phase::Calling,
            _ if self.nameless_s > self.settings.unknown_s => Phase::Calling,
            Phase::Climbing { kind, for_s } => match input.outcome {
                // The outcome of the cycle of the order is that of the one before.
                _ if for_s == 0.0 => Phase::Climbing { kind, for_s: dt_s },
                ActionOutcome::Succeeded => {
                    self.since_rung_s = 0.0;
                    Phase::Following { troubled_s: 0.0 }
                }
                ActionOutcome::Failed => self.climb(input.symptoms),
                _ if for_s > RUNG_MAX_S => self.climb(input.symptoms),
                _ => Phase::Climbing {
                    kind,
                    for_s: for_s + dt_s,
                },
            },
            Phase::Following { troubled_s } => self.follow(input.symptoms, troubled_s, dt_s),
        }
    }

    fn follow(&mut self, symptoms: u32, troubled_s: f64, dt_s: f64) -> Phase {
        if self.quiet_s >= self.settings.quiet_s {
            (self.climbed, self.found_its_place) = (0, false);
        }
        if symptoms == 0 || self.since_rung_s < self.settings.settle_s {
            return Phase::Following { troubled_s: 0.0 };
        }
        // Only the first rung waits.
        if self.climbed > 0 || troubled_s >= self.settings.wait_s {
            return self.climb(symptoms);
        }
        Phase::Following {
            troubled_s: troubled_s + dt_s,
        }
    }

    fn climb(&mut self, symptoms: u32) -> Phase {
        let for_s = 0.0;
        let EscalationSettings {
            rungs,
            rounds,
            order,
            finds_its_place_first,
            ..
        } = self.settings;
        if finds_its_place_first && symptoms & Symptoms::LD != 0 && !self.found_its_place {
            self.found_its_place = true;
            let kind = RecoveryKind::Relocalise;
            return Phase::Climbing { kind, for_s };
        }
        if self.climbed >= rungs * rounds {
            return Phase::Calling;
        }
        let kind = order[self.climbed % rungs].kind();
        self.climbed += 1;
        Phase::Climbing { kind, for_s }
    }

    fn is_nameless(&self, hardware: RuleInput) -> bool {
        hardware.alarm && hardware.explanation == Some(Cause::Unmodelled)
    }

    fn output(&self, hardware: RuleInput) -> RuleOutput {
        let named = hardware
            .explanation
            .filter(|cause| *cause != Cause::Unmodelled && hardware.p >= self.settings.p_min);
        let remedy = named.map(RuleOutput::remedy);
        match self.phase {
            Phase::Calling => RuleOutput::plain(RecoveryKind::CallForHelp),
            Phase::Following { .. } => remedy.unwrap_or(RuleOutput::plain(RecoveryKind::GoOn)),
            Phase::Climbing { kind, .. } => {
                let steers = remedy.filter(|it| it.kind == RecoveryKind::Compensate);
                RuleOutput {
                    kind,
                    wheels: steers.map_or(AnsweredWheels::default(), |it| it.wheels),
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use ActionOutcome::{Failed, Running, Succeeded};
    use RecoveryKind::{CallForHelp, Compensate, GoOn, GoThrough, NewPath, Relocalise};

    const SETTINGS: EscalationSettings = EscalationSettings {
        wait_s: 0.15,
        order: [
            Rung::GoThrough,
            Rung::NewPath,
            Rung::MoveAway,
            Rung::Relocalise,
        ],
        rungs: 2,
        rounds: 1,
        settle_s: 0.25,
        quiet_s: 0.25,
        finds_its_place_first: true,
        p_min: 0.8,
        unknown_s: 0.15,
    };

    const fn seen(symptoms: u32, outcome: ActionOutcome) -> LadderInput {
        LadderInput {
            symptoms,
            outcome,
            hardware: RuleInput {
                alarm: false,
                explanation: None,
                p: 1.0,
                several: false,
                limp_home: None,
            },
        }
    }

    fn said(sights: &[LadderInput]) -> Vec<(RecoveryKind, u64)> {
        let mut ladder = Escalation::new(SETTINGS);
        let mut orders = Vec::new();
        for sight in sights {
            let order = ladder.order(*sight, 0.1);
            orders.push((order.output.kind, order.number));
        }
        orders.dedup();
        orders
    }

    #[test]
    fn every_order_is_tried_once() {
        let all: Vec<_> = orders().collect();
        assert_eq!(all.len(), 24);
        let twice = |order| all.iter().filter(|other| *other == order).count() > 1;
        assert!(!all.iter().any(twice));
    }

    #[test]
    fn rungs_are_climbed_until_help_is_called_for() {
        let epm = Symptoms::EPM;
        let told = said(&[
            seen(0, Running),
            seen(epm, Running),
            seen(epm, Running),
            seen(epm, Running),
            // The order to go through; it fails.
            seen(epm, Running),
            seen(epm, Running),
            seen(epm, Failed),
            // A new path; it is found, but the symptom stays.
            seen(epm, Failed),
            seen(epm, Running),
            seen(epm, Succeeded),
            seen(epm, Running),
            seen(epm, Running),
            seen(epm, Running),
            seen(epm, Running),
        ]);
        let wanted = [
            (GoOn, 1),
            (GoThrough, 2),
            (NewPath, 3),
            (GoOn, 4),
            (CallForHelp, 5),
        ];
        assert_eq!(told, wanted);
    }

    #[test]
    fn a_lost_robot_finds_its_place_and_begins_anew_when_it_is_quiet() {
        let lost = [seen(Symptoms::LD, Running); 4];
        let done = [seen(0, Running), seen(0, Succeeded)];
        let quiet = [seen(0, Running); 4];
        let told = said(&[&lost[..], &done, &quiet, &lost].concat());
        let wanted = [(GoOn, 1), (Relocalise, 2), (GoOn, 3), (Relocalise, 4)];
        assert_eq!(told, wanted);
    }

    #[test]
    fn a_named_fault_is_answered_and_one_without_a_name_is_a_call() {
        let with = |explanation, p| LadderInput {
            hardware: RuleInput {
                alarm: true,
                explanation: Some(explanation),
                p,
                several: false,
                limp_home: None,
            },
            ..seen(0, Running)
        };
        let stuck = with(Cause::Stuck(2), 0.9);
        assert_eq!(said(&[stuck; 5]), [(Compensate, 1)]);
        assert_eq!(said(&[with(Cause::Stuck(2), 0.7); 5]), [(GoOn, 1)]);
        let nameless = with(Cause::Unmodelled, 0.9);
        assert_eq!(said(&[nameless; 5]), [(GoOn, 1), (CallForHelp, 2)]);
    }
}
