//! What stands until the filters are reset by whoever has helped: a call for help, and a task that
//! was given up. A robot that brakes and then stands looks healthy, whatever is wrong with it.

use vigil_blocks::RecoveryKind;
use vigil_checkpoint::Checkpoint;
use vigil_pomdp::{Choice, Control};

/// The action that stands, once it was taken.
#[derive(Debug, Clone, Copy, Default, Checkpoint)]
pub(crate) struct Latch {
    action: Option<usize>,
}

impl Latch {
    /// The choice to take where `best` is the policy's; `kind` says what an action does.
    pub(crate) fn choose(&mut self, best: Choice, kind: impl Fn(usize) -> RecoveryKind) -> Choice {
        let choice = match self.action {
            Some(action) if action != best.action => stands(action),
            _ => best,
        };
        let latches = matches!(
            kind(choice.action),
            RecoveryKind::CallForHelp | RecoveryKind::GiveUp
        );
        if self.action.is_none() && latches {
            self.action = Some(choice.action);
        }
        self.assert_stands(choice);
        choice
    }

    fn assert_stands(&self, choice: Choice) {
        assert!(
            self.action.is_none_or(|action| action == choice.action),
            "a latched action stands until a reset: {choice:?}"
        );
    }

    /// The action that stands.
    pub(crate) const fn action(&self) -> Option<usize> {
        self.action
    }

    /// Nothing stands any more.
    pub(crate) const fn release(&mut self) {
        self.action = None;
    }
}

/// The choice of an action that stands although another may be better.
pub(crate) const fn stands(action: usize) -> Choice {
    Choice {
        action,
        margin: 0.0,
        control: Control::Policy,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    #[should_panic(expected = "a latched action stands until a reset")]
    fn a_latch_that_is_left_is_caught() {
        Latch { action: Some(1) }.assert_stands(stands(2));
    }

    #[test]
    fn a_call_and_a_task_given_up_stand_until_they_are_released() {
        let kind = |action| match action {
            1 => RecoveryKind::CallForHelp,
            2 => RecoveryKind::GiveUp,
            _ => RecoveryKind::GoOn,
        };
        let best = |action| Choice {
            action,
            margin: 0.5,
            control: Control::Dual,
        };
        for called in [1, 2] {
            let mut latch = Latch::default();
            assert_eq!(latch.choose(best(0), kind), best(0));
            assert_eq!(latch.action(), None);
            assert_eq!(latch.choose(best(called), kind), best(called));
            for other in [0, 3 - called] {
                assert_eq!(latch.choose(best(other), kind), stands(called));
                assert_eq!(latch.action(), Some(called));
            }
            latch.release();
            assert_eq!(latch.choose(best(0), kind), best(0));
        }
    }
}
