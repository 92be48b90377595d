//! Stop at an alarm, and call for help if it stays.

use serde::{Deserialize, Serialize};
use vigil_blocks::RecoveryKind;

use super::{RuleInput, RuleOutput};

/// Its pause.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct StopAndCallSettings {
    /// Time for which an alarm must stand before help is called for, s; the rover stands meanwhile.
    pub wait_s: f64,
}

impl StopAndCallSettings {
    pub(super) const DIMENSIONS: usize = 1;

    pub(super) fn varied(self, _: usize) -> Vec<Self> {
        [0.0, 0.1, 0.3, 1.0, 3.0, 10.0]
            .map(|wait_s| Self { wait_s })
            .to_vec()
    }
}

/// The rule, one cycle at a time.
#[derive(Debug, Clone)]
pub struct StopAndCall {
    settings: StopAndCallSettings,
    stood_s: f64,
    calls: bool,
}

impl StopAndCall {
    /// At the beginning.
    #[must_use]
    pub const fn new(settings: StopAndCallSettings) -> Self {
        Self {
            settings,
            stood_s: 0.0,
            calls: false,
        }
    }

    /// The rule's answer, `dt_s` after the last cycle.
    pub fn answer(&mut self, input: RuleInput, dt_s: f64) -> RuleOutput {
        self.calls |= input.alarm && self.stood_s >= self.settings.wait_s;
        self.stood_s = if input.alarm {
            self.stood_s + dt_s
        } else {
            0.0
        };
        RuleOutput::plain(match (self.calls, input.alarm) {
            (true, _) => RecoveryKind::CallForHelp,
            (false, true) => RecoveryKind::Stop,
            (false, false) => RecoveryKind::GoOn,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_alarm_that_stays_is_answered_by_a_call() {
        let mut rule = StopAndCall::new(StopAndCallSettings { wait_s: 0.25 });
        let mut say = |alarm| rule.answer(RuleInput::of_alarm(alarm), 0.1).kind;
        use RecoveryKind::{CallForHelp, GoOn, Stop};
        let said = [false, true, true, false, true, true, true, true, false].map(&mut say);
        let wanted = [
            GoOn,
            Stop,
            Stop,
            GoOn,
            Stop,
            Stop,
            Stop,
            CallForHelp,
            CallForHelp,
        ];
        assert_eq!(said, wanted);
    }
}
