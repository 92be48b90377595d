//! Hysteresis of actions: decisions do not chatter, and help is not called for too early.
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
//!
//! A model that knows how old the unknown is (`UNKNOWN_OLD`) says itself when to call for help and
//! when to go on. Of these rules only the last holds for it.

use vigil_blocks::RecoveryKind;
use vigil_pomdp::policy::choose_among;
use vigil_pomdp::{Choice, Control};

use crate::mapping::ActionMeaning;

/// Epochs for which a less cautious action must be best before it is taken. Chosen by hand: at the
/// usual 100 ms an epoch, 0.3 s. With 1, noise of the belief makes actions alternate; more keeps a
/// robot slow after its fault has cleared.
pub(crate) const HOLD_EPOCHS: u32 = 3;
/// Epochs for which a call for help must be best before it is made: an identifier that has just
/// begun may not know yet, and a robot that stands still for help shows it nothing more. Chosen by
/// hand: 2 s at 100 ms an epoch. Fewer call for help while the identifier still decides between two
/// faults; more leave a robot with an unknown fault moving.
pub(crate) const HELP_EPOCHS: u32 = 20;

/// What has been best, and for how long.
#[derive(Debug, Clone)]
pub(crate) struct ActionHysteresis {
    candidate: usize,
    epochs: u32,
    help_epochs: u32,
    needed: Needed,
    /// True once going on was left.
    has_left: bool,
    /// The action that calls for help, once it has been taken.
    called: Option<usize>,
}

/// Epochs for which an action must be best before it is taken.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Needed {
    /// Calling for help.
    help: u32,
    /// Any that is faster than the present one.
    faster: u32,
    /// Going on, once it was left.
    going_on: u32,
}

impl ActionHysteresis {
    /// Going on, once left, must be best for `hold_epochs`, and [`HOLD_EPOCHS`] at least.
    pub(crate) fn new(hold_epochs: u32) -> Self {
        Self::needing(Needed {
            help: HELP_EPOCHS,
            faster: HOLD_EPOCHS,
            going_on: hold_epochs.max(HOLD_EPOCHS),
        })
    }

    /// The best action is taken at once: the decision model knows what it is to wait for.
    pub(crate) const fn at_once() -> Self {
        Self::needing(Needed {
            help: 0,
            faster: 0,
            going_on: 0,
        })
    }

    const fn needing(needed: Needed) -> Self {
        Self {
            needed,
            has_left: false,
            candidate: usize::MAX,
            epochs: 0,
            help_epochs: 0,
            called: None,
        }
    }

    /// Forgets everything: a new run, or whoever has helped.
    pub(crate) fn reset(&mut self) {
        *self = Self::needing(self.needed);
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
        let latched = self.called;
        if let Some(called) = latched.filter(|called| *called != best.action) {
            return hold(called);
        }
        let mut choice = best;
        if is_help(best.action) {
            self.help_epochs = self.help_epochs.saturating_add(u32::from(timed));
            let calling = current.is_some_and(is_help);
            let others = (0..values.len()).any(|action| !is_help(action));
            if self.help_epochs < self.needed.help && !calling && others {
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
        let choice = self.held_back(current, choice, meanings, timed);
        self.has_left &= !goes_on(meanings, choice.action);
        let has_waited = self.help_epochs >= self.needed.help;
        if self.called.is_none() && has_waited && is_help(choice.action) {
            self.called = Some(choice.action);
        }
        assert_latched(latched, self.called);
        choice
    }

    fn held_back(
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
            true => self.needed.going_on,
            false if speed(choice.action) > speed(current) => self.needed.faster,
            false => 0,
        };
        if self.epochs < needed {
            return hold(current);
        }
        choice
    }
}

/// The choice of an action that stands although another may be better.
pub(crate) const fn hold(action: usize) -> Choice {
    Choice {
        action,
        margin: 0.0,
        control: Control::Policy,
    }
}

/// What is latched stands until a reset.
pub(crate) fn assert_latched(before: Option<usize>, after: Option<usize>) {
    assert!(
        before.is_none() || after == before,
        "a latched action stands until a reset: {before:?}, {after:?}"
    );
}

/// True for going on as before.
fn goes_on(meanings: &[ActionMeaning], action: usize) -> bool {
    let kind = meanings.get(action).map(|m| m.kind);
    kind == Some(RecoveryKind::GoOn)
}

#[cfg(test)]
mod tests {
    use super::*;

    const GO: usize = 0;
    const SLOW: usize = 1;
    const STOP: usize = 2;
    const HELP: usize = 3;
    const IGNORE: usize = 4;
    /// What the actions are worth, whatever the policy chooses.
    const VALUES: [f64; 5] = [1.0, 3.0, 2.0, 9.0, 0.0];

    const fn meaning(kind: RecoveryKind, speed_scale: f64) -> ActionMeaning {
        ActionMeaning { kind, speed_scale }
    }

    const MEANINGS: [ActionMeaning; 5] = [
        meaning(RecoveryKind::GoOn, 1.0),
        meaning(RecoveryKind::SlowDown, 0.5),
        meaning(RecoveryKind::Stop, 0.0),
        meaning(RecoveryKind::CallForHelp, 0.0),
        meaning(RecoveryKind::IgnoreEncoder, 1.0),
    ];

    struct Robot {
        hysteresis: ActionHysteresis,
        current: Option<usize>,
        margin: f64,
    }

    impl Robot {
        fn new(hold_epochs: u32) -> Self {
            Self {
                hysteresis: ActionHysteresis::new(hold_epochs),
                current: None,
                margin: 0.0,
            }
        }

        /// The action that is taken where `action` is best.
        fn act(&mut self, action: usize, timed: bool) -> usize {
            let best = Choice {
                action,
                margin: 0.25,
                control: Control::Dual,
            };
            let choice = self
                .hysteresis
                .decide(self.current, best, &VALUES, &MEANINGS, timed);
            self.current = Some(choice.action);
            self.margin = choice.margin;
            choice.action
        }

        fn epochs(&mut self, count: u32, action: usize) -> Vec<usize> {
            (0..count).map(|_| self.act(action, true)).collect()
        }
    }

    #[test]
    fn what_is_more_cautious_is_taken_at_once_and_what_is_faster_in_the_third_epoch() {
        let mut robot = Robot::new(0);
        assert_eq!(robot.act(SLOW, true), SLOW);
        assert_eq!((robot.act(STOP, false), robot.margin), (STOP, 0.25));
        assert_eq!(robot.epochs(2, SLOW), [STOP, STOP]);
        assert_eq!(robot.margin, 0.0);
        assert_eq!(robot.epochs(1, SLOW), [SLOW]);
        // Only epochs count, and only in a row.
        robot.act(STOP, true);
        assert!((0..9).all(|_| robot.act(SLOW, false) == STOP));
        robot.epochs(2, SLOW);
        robot.act(STOP, true);
        assert_eq!(robot.epochs(3, SLOW), [STOP, STOP, SLOW]);
    }

    #[test]
    fn going_on_is_taken_again_after_the_hold_even_at_the_same_speed() {
        let mut robot = Robot::new(5);
        assert_eq!(robot.act(GO, true), GO);
        assert_eq!(robot.act(IGNORE, true), IGNORE);
        assert_eq!(robot.epochs(5, GO), [IGNORE, IGNORE, IGNORE, IGNORE, GO]);
        // Once it is taken, the hold is over.
        assert_eq!(robot.epochs(2, GO), [GO, GO]);
        assert_eq!(robot.act(IGNORE, false), IGNORE);
        robot.hysteresis.reset();
        assert_eq!(robot.act(GO, false), GO, "a reset ends the hold too");
        assert_eq!(robot.hysteresis.needed.going_on, 5);
        assert_eq!(Robot::new(1).hysteresis.needed.going_on, HOLD_EPOCHS);
    }

    #[test]
    fn help_is_called_for_in_the_twentieth_epoch_and_latched_until_a_reset() {
        let mut robot = Robot::new(0);
        robot.act(SLOW, true);
        // The best of the others meanwhile: by worth, not by what is first.
        assert!(robot.epochs(19, HELP).iter().all(|action| *action == SLOW));
        assert_eq!(robot.margin, 1.0);
        assert!((0..9).all(|_| robot.act(HELP, false) == SLOW));
        assert_eq!(robot.hysteresis.called(), None);
        assert_eq!(robot.act(HELP, true), HELP);
        assert_eq!(robot.hysteresis.called(), Some(HELP));
        assert_eq!((robot.act(GO, true), robot.margin), (HELP, 0.0));
        robot.hysteresis.reset();
        assert_eq!(robot.hysteresis.called(), None);
        // Another action in between begins the count anew.
        let mut robot = Robot::new(0);
        robot.epochs(19, HELP);
        robot.act(SLOW, true);
        assert!(robot.epochs(19, HELP).iter().all(|action| *action == SLOW));
    }

    #[test]
    fn a_model_that_knows_what_to_wait_for_is_obeyed_at_once_and_its_call_stands() {
        let mut robot = Robot::new(0);
        robot.hysteresis = ActionHysteresis::at_once();
        let said = [GO, SLOW, GO, STOP, SLOW].map(|action| robot.act(action, true));
        assert_eq!(said, [GO, SLOW, GO, STOP, SLOW]);
        assert_eq!(robot.act(HELP, false), HELP);
        assert_eq!(robot.act(GO, true), HELP);
        robot.hysteresis.reset();
        assert_eq!(robot.act(GO, false), GO);
    }

    #[test]
    fn where_nothing_but_help_is_left_it_is_called_for_at_once() {
        let mut hysteresis = ActionHysteresis::new(0);
        let help = [meaning(RecoveryKind::CallForHelp, 0.0)];
        let choice = hysteresis.decide(None, hold(0), &[1.0], &help, true);
        assert_eq!((choice.action, hysteresis.called()), (0, None));
    }

    #[test]
    #[should_panic(expected = "a latched action stands until a reset: Some(3), Some(1)")]
    fn a_latch_that_is_released_is_caught() {
        assert_latched(None, Some(HELP));
        assert_latched(Some(HELP), Some(HELP));
        assert_latched(Some(HELP), Some(SLOW));
    }
}
