//! A change of action has its price: a robot that brakes and speeds up twice a second wears out,
//! and nobody can read what it is about.
//!
//! An action is left for another once what the other would have earned more, summed over time,
//! is the price: the rule of the ski rental (Karlin, Manasse, Rudolph and Sleator, Algorithmica
//! 1988), which pays at most twice what the best moment to change would have cost. What is much
//! better is so taken at once, what is a little better after a while, and two actions that take
//! turns in being better do not take turns in being taken.

use vigil_blocks::DECISION_ACTIONS;
use vigil_checkpoint::Checkpoint;

/// What was lost so far by not taking other actions.
#[derive(Debug, Clone, Checkpoint)]
pub(crate) struct SwitchingCost {
    #[checkpoint(fixed)]
    cost: f64,
    /// For each action what it would have earned more, never below 0.
    regret: [f64; DECISION_ACTIONS],
}

impl SwitchingCost {
    /// `cost` in the decision model's rewards.
    pub(crate) const fn new(cost: f64) -> Self {
        Self {
            cost,
            regret: [0.0; DECISION_ACTIONS],
        }
    }

    /// True if `held` is to be left for `best`. `values` are those of all actions, taken for one
    /// epoch; `share` of an epoch has passed since the last decision.
    pub(crate) fn is_due(&mut self, held: usize, best: usize, values: &[f64], share: f64) -> bool {
        let own = values.get(held).copied().unwrap_or(f64::NEG_INFINITY);
        for (regret, value) in self.regret.iter_mut().zip(values) {
            *regret = (*regret + share * (value - own)).max(0.0);
        }
        let lost = self.regret.get(best).copied().unwrap_or(f64::INFINITY);
        let gain = values.get(best).map_or(f64::INFINITY, |value| value - own);
        let is_due = held != best && lost.max(gain) >= self.cost;
        if is_due {
            self.forget();
        }
        is_due
    }

    /// Nothing was lost.
    pub(crate) const fn forget(&mut self) {
        self.regret = [0.0; DECISION_ACTIONS];
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The actions that are held while the values are these.
    fn held(cost: f64, values: &[[f64; 2]]) -> Vec<usize> {
        let (mut switching, mut held) = (SwitchingCost::new(cost), 0);
        let hold = |values: &[f64; 2]| {
            let best = usize::from(values[1] > values[0]);
            if switching.is_due(held, best, values, 1.0) {
                held = best;
            }
            held
        };
        values.iter().map(hold).collect()
    }

    #[test]
    fn what_is_lost_adds_up_to_the_price() {
        let (much, little, less) = ([0.0, 2.0], [0.0, 0.5], [0.0, -1.0]);
        assert_eq!(held(1.0, &[much]), [1]);
        assert_eq!(held(1.0, &[little, little, little]), [0, 1, 1]);
        assert_eq!(held(1.0, &[little, less, little, little]), [0, 0, 0, 1]);
        assert_eq!(held(0.0, &[little, less, little]), [1, 0, 1]);
        // Half an epoch counts half.
        let mut switching = SwitchingCost::new(1.0);
        assert!(!switching.is_due(0, 1, &little, 1.0));
        assert!(!switching.is_due(0, 1, &little, 0.5));
        assert!(switching.is_due(0, 1, &little, 0.5));
        // What is worth it in one epoch is taken at once.
        assert!(switching.is_due(0, 1, &much, 0.01));
        // Equal ones are not worth a change, whatever it costs.
        assert_eq!(held(0.0, &[[1.0, 1.0]]), [0]);
    }

    #[test]
    fn actions_that_take_turns_in_being_better_are_kept() {
        let turns: Vec<[f64; 2]> = (0..100).map(|k| [0.0, [0.4, -0.4][k % 2]]).collect();
        assert_eq!(held(1.0, &turns), [0; 100]);
    }

    #[test]
    fn a_price_that_is_paid_buys_a_new_start() {
        let turns = [[0.0, 1.0], [0.5, 0.0], [0.5, 0.0]];
        assert_eq!(held(1.0, &turns), [1, 1, 0]);
    }
}
