//! What stands until the filters are reset by whoever has helped: a call for help, and a task that
//! was given up. A robot that brakes and then stands looks healthy, whatever is wrong with it.

use vigil_blocks::RecoveryKind;
use vigil_checkpoint::Checkpoint;
use vigil_pomdp::{Choice, Control};

/// The action that stands, once it was taken.
#[derive(Debug, Clone, Copy, Default, Checkpoint)]
pub(crate) struct Latch {
    action: Option<usize>,
    /// Nothing is latched at present.
    is_open: bool,
}

impl Latch {
    /// The choice to take where `best` is the policy's; `kind` says what an action does.
    pub(crate) fn choose(&mut self, best: Choice, kind: impl Fn(usize) -> RecoveryKind) -> Choice {
        let choice = match self.action {
            Some(action) if action != best.action => stands(action),
            _ => best,
        };
        if self.action.is_none() && !self.is_open && latches(kind(choice.action)) {
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

    /// Whether nothing is to be latched at present: what would be is not known well enough.
    pub(crate) const fn keep_open(&mut self, is_open: bool) {
        self.is_open = is_open;
    }

    /// This action stands, as it did for an earlier supervisor.
    pub(crate) const fn restore(&mut self, action: usize) {
        self.action = Some(action);
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

/// True of what stands once it was taken.
pub(crate) const fn latches(kind: RecoveryKind) -> bool {
    matches!(kind, RecoveryKind::CallForHelp | RecoveryKind::GiveUp)
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
        let mut latch = Latch::default();
        latch.restore(1);
        latch.assert_stands(stands(2));
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
            latch.keep_open(true);
            assert_eq!(latch.choose(best(called), kind), best(called));
            assert_eq!(latch.action(), None);
            latch.restore(called);
            assert_eq!(latch.choose(best(0), kind), stands(called));
            latch.release();
            assert_eq!(latch.choose(best(0), kind), best(0));
        }
    }
}
