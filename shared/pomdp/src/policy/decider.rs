//! A policy, and what explains its decisions.

use super::{Choice, Control, Measure, Policy, Votes, normalised_entropy};
use crate::bounds::mdp::Solution;
use crate::model::Pomdp;

/// A decision and what it rests on; values and votes are [`Decider::values`] and
/// [`Decider::votes`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Decision {
    /// Index of the action.
    pub action: usize,
    /// Its value (or votes) minus the runner-up's; 0 at a tie or with one action.
    pub margin: f64,
    /// What the action was chosen for.
    pub control: Control,
    /// Entropy of the belief, 0 to 1.
    pub state_entropy: f64,
    /// Entropy of the votes, 0 to 1.
    pub action_entropy: f64,
    /// What the values are.
    pub measure: Measure,
}

impl Decision {
    /// Without what explains it.
    #[must_use]
    pub const fn choice(&self) -> Choice {
        Choice {
            action: self.action,
            margin: self.margin,
            control: self.control,
        }
    }
}

/// Decides by a policy. Preallocated.
pub struct Decider {
    policy: Box<dyn Policy>,
    values: Vec<f64>,
    votes: Votes,
    action_entropy: f64,
    measure: Measure,
}

impl Decider {
    /// Around `policy`, for a model and its fully observable relaxation.
    #[must_use]
    pub fn new(policy: Box<dyn Policy>, model: &Pomdp, solution: &Solution) -> Self {
        Self {
            policy,
            values: vec![0.0; model.actions().len()],
            votes: Votes::new(solution),
            action_entropy: 0.0,
            measure: Measure::Value,
        }
    }

    /// The action for a belief of one probability a state.
    pub fn decide(&mut self, belief: &[f64]) -> Decision {
        let choice = self.policy.evaluate(belief, &mut self.values);
        assert!(
            choice.action < self.values.len() && choice.margin >= 0.0,
            "the action that a policy chooses is one of the model's, its margin not negative: \
             {choice:?}"
        );
        self.votes.count(belief);
        self.action_entropy = self.votes.entropy();
        self.measure = match choice.control {
            Control::Dual => Measure::Entropy,
            Control::Policy | Control::Stalled => self.policy.measure(),
        };
        Decision {
            action: choice.action,
            margin: choice.margin,
            control: choice.control,
            state_entropy: normalised_entropy(belief),
            action_entropy: self.action_entropy,
            measure: self.measure,
        }
    }

    /// Spends a share of spare time on `belief`; what is known of the last decision stands.
    pub fn improve(&mut self, belief: &[f64]) {
        self.policy.improve(belief);
    }

    /// What the policy thinks of every action, as of the last decision: values or votes, the
    /// larger the better; in a step for information the expected entropies, negative.
    #[must_use]
    pub fn values(&self) -> &[f64] {
        &self.values
    }

    /// What [`Self::values`] are.
    #[must_use]
    pub const fn measure(&self) -> Measure {
        self.measure
    }

    /// Entropy of the votes, 0 to 1, as of the last decision.
    #[must_use]
    pub const fn action_entropy(&self) -> f64 {
        self.action_entropy
    }

    /// For each action, how much of the belief is in states whose best action it is, as of the last
    /// decision: 0 to 1.
    #[must_use]
    pub fn votes(&self) -> &[f64] {
        self.votes.counted()
    }

    /// A new mission begins.
    pub fn reset(&mut self) {
        self.policy.reset();
    }

    /// Gives away the last decision, and what the policy remembers, as numbers.
    pub fn keep(&self, put: &mut dyn FnMut(f64)) {
        self.values.iter().for_each(|value| put(*value));
        self.votes.keep(put);
        put(self.action_entropy);
        put(f64::from(self.measure as u8));
        self.policy.keep(put);
    }

    /// Goes on from what [`Self::keep`] gave away under the same model and policy.
    pub fn resume(&mut self, take: &mut dyn FnMut() -> f64) {
        self.values.iter_mut().for_each(|value| *value = take());
        self.votes.resume(take);
        self.action_entropy = take();
        self.measure = match take() as u8 {
            0 => Measure::Value,
            1 => Measure::Votes,
            _ => Measure::Entropy,
        };
        self.policy.resume(take);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bounds::mdp;

    /// Chooses an action that the model lacks.
    struct Stray;

    impl Policy for Stray {
        fn evaluate(&mut self, _: &[f64], values: &mut [f64]) -> Choice {
            Choice {
                action: values.len(),
                margin: 0.0,
                control: Control::Policy,
            }
        }
    }

    #[test]
    #[should_panic(expected = "the action that a policy chooses is one of the model's")]
    fn an_action_that_the_model_lacks_is_caught() {
        let text = "discount: 0.5\nvalues: reward\nstates: 1\nactions: 1\nT: * identity\n";
        let model = Pomdp::parse(text).unwrap();
        let solution = mdp::solve(&model).unwrap();
        Decider::new(Box::new(Stray), &model, &solution).decide(&[1.0]);
    }
}
