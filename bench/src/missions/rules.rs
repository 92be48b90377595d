//! The rules to beat: what a good engineer writes over the same detector and identifier.
//!
//! Each family is tuned: every pause, threshold and order that it has is swept on other missions
//! than those of the measurement ([`super::sweep`]).

mod careful;
mod ladder;
mod stop_and_call;

pub use careful::{Careful, CarefulSettings};
pub use ladder::{Ladder, LadderSettings};
pub use stop_and_call::{StopAndCall, StopAndCallSettings};

use serde::{Deserialize, Serialize};
use vigil_blocks::{AnsweredWheels, RecoveryKind};

use super::breakdown::Cause;

/// What the rules see in one cycle.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RuleInput {
    /// The detector's alarm.
    pub alarm: bool,
    /// The identifier's most probable explanation; `None` if nothing is wrong.
    pub explanation: Option<Cause>,
    /// Its probability.
    pub p: f64,
    /// True if the identifier holds two faults or more for more probable than not.
    pub several: bool,
    /// What answers the most probable set of several faults, if anything does.
    pub limp_home: Option<RuleOutput>,
}

#[cfg(test)]
impl RuleInput {
    /// An alarm, or none, of which nothing is known.
    const fn of_alarm(alarm: bool) -> Self {
        Self {
            alarm,
            explanation: None,
            p: 1.0,
            several: false,
            limp_home: None,
        }
    }
}

/// What the rules say.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct RuleOutput {
    /// Kind of action.
    pub kind: RecoveryKind,
    /// The wheels it is about.
    pub wheels: AnsweredWheels,
}

impl RuleOutput {
    /// An action that is about no wheel.
    #[must_use]
    pub fn plain(kind: RecoveryKind) -> Self {
        Self {
            kind,
            wheels: AnsweredWheels::default(),
        }
    }

    /// What a cause asks for: counter-steer, ignore the encoder, go slowly.
    #[must_use]
    pub fn remedy(cause: Cause) -> Self {
        let kind = match cause {
            Cause::Stuck(_) => RecoveryKind::Compensate,
            Cause::Encoder(_) => RecoveryKind::IgnoreEncoder,
            Cause::Unmodelled => RecoveryKind::SlowDown,
        };
        Self {
            kind,
            wheels: cause.wheels(),
        }
    }

    /// What several causes ask for, if a rover with these can be driven: two stuck wheels on one
    /// side cannot be steered against.
    #[must_use]
    pub fn limp_home(causes: impl IntoIterator<Item = Cause>) -> Option<Self> {
        let mut wheels = AnsweredWheels::default();
        for cause in causes {
            if cause == Cause::Unmodelled {
                return None;
            }
            wheels = wheels.with(cause.wheels());
        }
        let on_a_side = |side: std::ops::Range<usize>| {
            let stuck = side.filter(|wheel| wheels.has_stuck(*wheel));
            stuck.count()
        };
        let is_drivable = on_a_side(0..3) <= 1 && on_a_side(3..6) <= 1;
        let order = Self {
            kind: RecoveryKind::LimpHome,
            wheels,
        };
        is_drivable.then_some(order)
    }

    /// Share of the planned speed, as Vigil's actions have it by default.
    #[must_use]
    pub const fn speed_scale(self) -> f64 {
        match self.kind {
            RecoveryKind::GoOn
            | RecoveryKind::IgnoreEncoder
            | RecoveryKind::GoThrough
            | RecoveryKind::MoveAway => 1.0,
            RecoveryKind::Compensate | RecoveryKind::LimpHome => 0.7,
            RecoveryKind::SlowDown => 0.5,
            _ => 0.0,
        }
    }
}

/// The best of each family.
#[derive(Debug, Clone, Copy, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Rules {
    /// Looks, then remedies.
    pub careful: CarefulSettings,
    /// Stops, then calls for help.
    pub stop_and_call: StopAndCallSettings,
    /// Slows down, stops, calls for help, whatever it is.
    pub ladder: LadderSettings,
}

/// A rule with its settings.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
#[serde(untagged)]
pub enum Rule {
    /// Looks, then remedies.
    Careful(CarefulSettings),
    /// Stops, then calls for help.
    StopAndCall(StopAndCallSettings),
    /// Slows down, stops, calls for help, whatever it is.
    Ladder(LadderSettings),
}

impl Rule {
    /// In words.
    #[must_use]
    pub const fn name(&self) -> &'static str {
        match self {
            Self::Careful(_) => "careful",
            Self::StopAndCall(_) => "stop and call",
            Self::Ladder(_) => "ladder",
        }
    }

    /// Settings that can be varied.
    #[must_use]
    pub const fn dimensions(&self) -> usize {
        match self {
            Self::Careful(_) => CarefulSettings::DIMENSIONS,
            Self::StopAndCall(_) => StopAndCallSettings::DIMENSIONS,
            Self::Ladder(_) => LadderSettings::DIMENSIONS,
        }
    }

    /// The rule with each value that one of its settings may have.
    #[must_use]
    pub fn varied(&self, dimension: usize) -> Vec<Self> {
        match self {
            Self::Careful(s) => s.varied(dimension).into_iter().map(Self::Careful).collect(),
            Self::StopAndCall(s) => {
                let varied = s.varied(dimension).into_iter();
                varied.map(Self::StopAndCall).collect()
            }
            Self::Ladder(s) => s.varied(dimension).into_iter().map(Self::Ladder).collect(),
        }
    }
}

/// What follows a rule, one cycle at a time.
#[derive(Debug, Clone)]
pub enum Follower {
    /// Looks, then remedies.
    Careful(Careful),
    /// Stops, then calls for help.
    StopAndCall(StopAndCall),
    /// Slows down, stops, calls for help.
    Ladder(Ladder),
}

impl Follower {
    /// At the beginning.
    #[must_use]
    pub const fn new(rule: Rule) -> Self {
        match rule {
            Rule::Careful(settings) => Self::Careful(Careful::new(settings)),
            Rule::StopAndCall(settings) => Self::StopAndCall(StopAndCall::new(settings)),
            Rule::Ladder(settings) => Self::Ladder(Ladder::new(settings)),
        }
    }

    /// The rule's answer, `dt_s` after the last cycle.
    pub fn answer(&mut self, input: RuleInput, dt_s: f64) -> RuleOutput {
        match self {
            Self::Careful(rule) => rule.answer(input, dt_s),
            Self::StopAndCall(rule) => rule.answer(input, dt_s),
            Self::Ladder(rule) => rule.answer(input, dt_s),
        }
    }
}
