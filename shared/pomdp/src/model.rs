//! A POMDP in the form that tracking and deciding need: sparse transitions, dense columns of Z.

mod build;
mod distribution;
mod goals;
mod hash;
mod joint;
pub(crate) mod rewards;
pub(crate) mod sparse;

pub(crate) use build::Parts;
pub use build::Probabilities;
pub(crate) use distribution::{RowSum, SUM_TOLERANCE, check_probability};

use crate::parse_error::Position;
use goals::Goals;
use joint::Joint;
use rewards::Rewards;
use sparse::Sparse;

/// Something about a model that its author may want to mend.
#[derive(Debug, Clone, PartialEq)]
pub struct Warning {
    /// Where.
    pub at: Position,
    /// What.
    pub message: String,
}

/// A partially observable Markov decision process.
///
/// States, actions and observations are numbered from 0, in the order of their names. What is asked
/// of an index that the model lacks has no meaning, or panics. Two models are equal if all their
/// names and numbers are; warnings do not count.
#[derive(Debug, Clone)]
pub struct Pomdp {
    discount: f64,
    is_cost: bool,
    states: Vec<String>,
    actions: Vec<String>,
    observations: Vec<String>,
    start: Vec<f64>,
    /// Per action: for each s the successors and their probabilities.
    transitions: Vec<Sparse>,
    /// Z[a][z][s'].
    observation: Vec<f64>,
    rewards: Rewards,
    /// R[a][s], expected.
    reward: Vec<f64>,
    /// With discount 1.
    goals: Option<Goals>,
    /// T and Z in one, unless that is too large.
    joint: Option<Joint>,
    hash: u64,
    warnings: Vec<Warning>,
}

impl PartialEq for Pomdp {
    fn eq(&self, other: &Self) -> bool {
        self.hash == other.hash
            && self.is_cost == other.is_cost
            && self.discount == other.discount
            && self.states == other.states
            && self.actions == other.actions
            && self.observations == other.observations
            && self.start == other.start
            && self.transitions == other.transitions
            && self.observation == other.observation
            && self.rewards == other.rewards
            && self.reward == other.reward
    }
}

impl Pomdp {
    /// Names of the states.
    #[must_use]
    pub fn states(&self) -> &[String] {
        &self.states
    }

    /// Names of the actions.
    #[must_use]
    pub fn actions(&self) -> &[String] {
        &self.actions
    }

    /// Names of the observations; `none` alone for a model without any.
    #[must_use]
    pub fn observations(&self) -> &[String] {
        &self.observations
    }

    /// Discount per step, 0 to 1.
    #[must_use]
    pub const fn discount(&self) -> f64 {
        self.discount
    }

    /// True if the file states costs (`values: cost`). Rewards here are their negatives.
    #[must_use]
    pub const fn is_cost(&self) -> bool {
        self.is_cost
    }

    /// Start belief, one probability a state.
    #[must_use]
    pub fn start(&self) -> &[f64] {
        &self.start
    }

    /// R(s,a), the expected immediate reward; costs count negative.
    #[must_use]
    pub fn reward(&self, state: usize, action: usize) -> f64 {
        self.reward[action * self.states.len() + state]
    }

    /// R(s,a,s',z), the reward of one outcome; costs count negative. [`Self::reward`] is its
    /// expectation.
    #[must_use]
    pub fn reward_of(&self, state: usize, action: usize, next: usize, observation: usize) -> f64 {
        self.rewards.block(state, action).at(next, observation)
    }

    /// True if some reward depends on s' or z.
    #[must_use]
    pub fn has_outcome_rewards(&self) -> bool {
        let mut blocks = self.rewards.blocks().iter();
        blocks.any(|block| !block.others.is_empty())
    }

    /// Successors of `state` under `action`: (s', probability), s' ascending.
    #[must_use]
    pub fn successors(&self, state: usize, action: usize) -> &[(usize, f64)] {
        self.transitions[action].row(state)
    }

    /// True if the discount is 1 and nothing is earned from this state on, whatever is done: it
    /// belongs to a set of states without rewards that no action leaves.
    #[must_use]
    pub fn is_goal(&self, state: usize) -> bool {
        let goals = self.goals.as_ref();
        goals.is_some_and(|goals| goals.is_goal[state])
    }

    /// Successors after which something may still be earned: all, but for goals.
    pub(crate) fn moves(&self, state: usize, action: usize) -> &[(usize, f64)] {
        match &self.goals {
            Some(goals) => goals.moves[action].row(state),
            None => self.successors(state, action),
        }
    }

    /// True if a goal may be reached in one step, or has been.
    pub(crate) fn may_end(&self, state: usize, action: usize) -> bool {
        self.moves(state, action).len() < self.successors(state, action).len()
    }

    /// Z(a,s',z) for every s': the probability of the observation in each state that is reached.
    #[must_use]
    pub fn likelihood(&self, action: usize, observation: usize) -> &[f64] {
        let n = self.states.len();
        let first = (action * self.observations.len() + observation) * n;
        &self.observation[first..first + n]
    }

    /// True if there is nothing to observe: one observation `none`, certain everywhere.
    #[must_use]
    pub fn is_mdp(&self) -> bool {
        let certain = |action| self.likelihood(action, 0).iter().all(|p| *p == 1.0);
        self.observations() == ["none"] && (0..self.actions().len()).all(certain)
    }

    /// Hash over everything that has a meaning: numbers and names, not comments or layout. A cost
    /// hashes as the negative reward that it is.
    #[must_use]
    pub const fn hash(&self) -> u64 {
        self.hash
    }

    /// What the author may want to mend.
    #[must_use]
    pub fn warnings(&self) -> &[Warning] {
        &self.warnings
    }

    pub(crate) const fn joint(&self) -> Option<&Joint> {
        self.joint.as_ref()
    }

    #[cfg(feature = "solver")]
    pub(crate) const fn rewards(&self) -> &Rewards {
        &self.rewards
    }
}
