//! Keeps decisions from chattering and from crying wolf.
//!
//! - An action that lets the robot move faster than the present one must be best for
//!   [`HOLD_EPOCHS`] epochs in a row, and going on as before, once it was left, for as long as the
//!   settings say (`supervisor.hold_s`): weak evidence that lasts must not make a robot slow down
//!   and go on by turns. A more cautious action is taken at once.
//! - Help is called for only when that has been best for [`HELP_EPOCHS`] epochs in a row; until
//!   then the best of the other actions is taken, by what they are worth: votes and entropies rank
//!   only the best.
//! - A call for help stands until the filters are reset by whoever has helped. A robot that brakes
//!   and then stands looks healthy, whatever is wrong with it: what pulls at it pulls no more.

use vigil_blocks::RecoveryKind;
use vigil_pomdp::policy::choose_among;
use vigil_pomdp::{Choice, Control};

use crate::mapping::ActionMeaning;

/// Epochs for which a less cautious action must be best before it is taken.
pub(crate) const HOLD_EPOCHS: u32 = 3;
/// Epochs for which a call for help must be best before it is made: an identifier that has just
/// begun may not know yet, and a robot that stands still for help shows it nothing more.
pub(crate) const HELP_EPOCHS: u32 = 20;

/// What has been best, and for how long.
#[derive(Debug, Clone)]
pub(crate) struct Restraint {
    candidate: usize,
    epochs: u32,
    help_epochs: u32,
    /// Epochs for which going on must be best before it is taken again, and whether it was left.
    hold_epochs: u32,
    has_left: bool,
    /// The action that calls for help, once it has been taken.
    called: Option<usize>,
}

impl Restraint {
    pub(crate) const fn new(hold_epochs: u32) -> Self {
        Self {
            hold_epochs: if hold_epochs > HOLD_EPOCHS {
                hold_epochs
            } else {
                HOLD_EPOCHS
            },
            has_left: false,
            candidate: usize::MAX,
            epochs: 0,
            help_epochs: 0,
            called: None,
        }
    }

    /// The call for help that stands.
    pub(crate) const fn called(&self) -> Option<usize> {
        self.called
    }

    /// The action to take. `current` is the present action, `best` the policy's choice, `values`
    /// every action's value (no votes, no entropies), `timed` is true once per epoch. The margin is
    /// to the best of the other actions that are allowed; 0 where the present action is held
    /// against a better one.
    pub(crate) fn decide(
        &mut self,
        current: Option<usize>,
        best: Choice,
        values: &[f64],
        meanings: &[ActionMeaning],
        timed: bool,
    ) -> Choice {
        let is_help = |action: usize| {
            meanings
                .get(action)
                .is_some_and(|m| m.kind == RecoveryKind::CallForHelp)
        };
        if let Some(called) = self.called.filter(|called| *called != best.action) {
            return Choice {
                action: called,
                margin: 0.0,
                control: Control::Policy,
            };
        }
        let mut choice = best;
        if is_help(best.action) {
            self.help_epochs = self.help_epochs.saturating_add(u32::from(timed));
            let calling = current.is_some_and(is_help);
            let others = (0..values.len()).any(|action| !is_help(action));
            if self.help_epochs < HELP_EPOCHS && !calling && others {
                choice = Choice {
                    control: best.control,
                    ..choose_among(values, |action| !is_help(action))
                };
            }
        } else {
            self.help_epochs = 0;
        }
        // A stop by rule, and its end, are not the policy's doing.
        self.has_left |= !goes_on(meanings, choice.action);
        let choice = self.hold(current, choice, meanings, timed);
        self.has_left &= !goes_on(meanings, choice.action);
        if self.called.is_none() && self.help_epochs >= HELP_EPOCHS && is_help(choice.action) {
            self.called = Some(choice.action);
        }
        choice
    }

    fn hold(
        &mut self,
        current: Option<usize>,
        choice: Choice,
        meanings: &[ActionMeaning],
        timed: bool,
    ) -> Choice {
        let Some(current) = current else {
            return choice;
        };
        if choice.action != self.candidate {
            self.candidate = choice.action;
            self.epochs = 0;
        }
        self.epochs = self.epochs.saturating_add(u32::from(timed));
        let speed = |action: usize| meanings.get(action).map_or(0.0, |m| m.speed_scale);
        // Going on at the same speed gives up what was done about a fault, too.
        let resumes = self.has_left && goes_on(meanings, choice.action) && choice.action != current;
        let needed = match resumes {
            true => self.hold_epochs,
            false if speed(choice.action) > speed(current) => HOLD_EPOCHS,
            false => 0,
        };
        if self.epochs < needed {
            return Choice {
                action: current,
                margin: 0.0,
                control: Control::Policy,
            };
        }
        choice
    }
}

/// True for going on as before.
fn goes_on(meanings: &[ActionMeaning], action: usize) -> bool {
    let kind = meanings.get(action).map(|m| m.kind);
    kind == Some(RecoveryKind::GoOn)
}
