//! An escalation ladder: the same steps at every alarm, whatever is wrong.

use serde::{Deserialize, Serialize};
use vigil_blocks::RecoveryKind;

use super::{RuleInput, RuleOutput};

/// Its steps.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LadderSettings {
    /// Time of going slowly, s.
    pub slow_s: f64,
    /// Time of standing, s.
    pub stand_s: f64,
    /// True to stand first.
    pub stands_first: bool,
    /// Time without an alarm after which it begins anew, s.
    pub quiet_s: f64,
}

impl LadderSettings {
    pub(super) const DIMENSIONS: usize = 4;

    pub(super) fn varied(self, dimension: usize) -> Vec<Self> {
        let steps_s = [0.0, 0.3, 1.0, 3.0, 10.0, 1000.0];
        match dimension {
            0 => steps_s.map(|slow_s| Self { slow_s, ..self }).to_vec(),
            1 => steps_s.map(|stand_s| Self { stand_s, ..self }).to_vec(),
            2 => [false, true]
                .map(|stands_first| Self {
                    stands_first,
                    ..self
                })
                .to_vec(),
            _ => [0.1, 1.0, 5.0]
                .map(|quiet_s| Self { quiet_s, ..self })
                .to_vec(),
        }
    }
}

/// The ladder, one cycle at a time.
#[derive(Debug, Clone)]
pub struct Ladder {
    settings: LadderSettings,
    climbed_s: Option<f64>,
    quiet_s: f64,
}

impl Ladder {
    /// At its foot.
    #[must_use]
    pub const fn new(settings: LadderSettings) -> Self {
        Self {
            settings,
            climbed_s: None,
            quiet_s: 0.0,
        }
    }

    /// The ladder's answer, `dt_s` after the last cycle.
    pub fn answer(&mut self, input: RuleInput, dt_s: f64) -> RuleOutput {
        self.quiet_s = if input.alarm {
            0.0
        } else {
            self.quiet_s + dt_s
        };
        self.climbed_s = match self.climbed_s {
            None => input.alarm.then_some(0.0),
            Some(_) if self.quiet_s >= self.settings.quiet_s => None,
            Some(climbed_s) => Some(climbed_s + dt_s),
        };
        RuleOutput::plain(self.climbed_s.map_or(RecoveryKind::GoOn, |climbed_s| {
            let LadderSettings {
                slow_s, stand_s, ..
            } = self.settings;
            let slow = (slow_s, RecoveryKind::SlowDown);
            let stand = (stand_s, RecoveryKind::Stop);
            let steps = match self.settings.stands_first {
                true => [stand, slow],
                false => [slow, stand],
            };
            let mut until_s = 0.0;
            let step = steps.into_iter().find(|(lasts_s, _)| {
                until_s += lasts_s;
                climbed_s < until_s
            });
            step.map_or(RecoveryKind::CallForHelp, |(_, kind)| kind)
        }))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_ladder_is_climbed_step_by_step_and_left_when_it_is_quiet() {
        let settings = LadderSettings {
            slow_s: 0.15,
            stand_s: 0.1,
            stands_first: true,
            quiet_s: 0.15,
        };
        let mut ladder = Ladder::new(settings);
        let mut say = |alarm| ladder.answer(RuleInput::of_alarm(alarm), 0.1).kind;
        use RecoveryKind::{CallForHelp, GoOn, SlowDown, Stop};
        let said = [false, true, true, false, false, true, true, true, true].map(&mut say);
        let wanted = [
            GoOn,
            Stop,
            SlowDown,
            SlowDown,
            GoOn,
            Stop,
            SlowDown,
            SlowDown,
            CallForHelp,
        ];
        assert_eq!(said, wanted);
    }
}
