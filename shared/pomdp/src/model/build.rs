//! From what a reader has collected to a model: rows are checked, expected rewards computed.

use super::hash::hash;
use super::joint::Joint;
use super::rewards::Rewards;
use super::sparse::Sparse;
use super::{Pomdp, Warning};
use crate::parse_error::{ParseError, Position};

/// Row sums may differ from 1 by this much; beyond it the model is refused. Public files are
/// written with six digits.
pub(crate) const ROW_SUM_TOLERANCE: f64 = 1e-5;
/// Row sums that differ from 1 by more than this are worth a warning.
pub(crate) const ROW_SUM_WARNING: f64 = 1e-9;
/// Most warnings of one model; the rest is counted: nobody reads more.
const WARNINGS_MAX: usize = 100;

/// What a reader has collected.
pub(crate) struct Parts {
    pub discount: f64,
    /// The file speaks of costs. `rewards` are rewards all the same.
    pub is_cost: bool,
    pub states: Vec<String>,
    pub actions: Vec<String>,
    pub observations: Vec<String>,
    pub start: Vec<f64>,
    /// Where the start belief is given.
    pub start_at: Position,
    /// Per action: for each s the successors.
    pub transitions: Vec<Sparse>,
    /// Z[a][z][s'].
    pub observation: Vec<f64>,
    pub rewards: Rewards,
    /// Where row (a, s) of T and row (a, s') of Z was written, states running faster.
    pub row_at: [Vec<Position>; 2],
    /// What is to be told besides.
    pub warnings: Vec<Warning>,
}

/// The probabilities of a model, to replace another's.
#[derive(Debug, Clone, PartialEq)]
pub struct Probabilities {
    /// b(s) before the first action.
    pub start: Vec<f64>,
    /// By action and state: the successors with their T(s,a,s').
    pub transitions: Vec<Vec<Vec<(usize, f64)>>>,
    /// Z(a,s',z), by action, then observation; the state runs fastest.
    pub likelihoods: Vec<f64>,
}

impl Pomdp {
    /// The same states, actions, observations, discount and rewards with other probabilities.
    ///
    /// # Errors
    /// [`ParseError`] for what is no distribution, and for rewards whose expectation overflows.
    ///
    /// # Panics
    /// If a table has another size than this model's.
    pub fn with_probabilities(&self, probabilities: Probabilities) -> Result<Self, ParseError> {
        let (states, actions) = (self.states.len(), self.actions.len());
        let Probabilities {
            start,
            transitions,
            likelihoods,
        } = probabilities;
        let has_rows = transitions.iter().all(|rows| rows.len() == states);
        assert!(
            start.len() == states && transitions.len() == actions && has_rows,
            "start belief and transitions have the size of the model"
        );
        assert_eq!(
            likelihoods.len(),
            actions * self.observations.len() * states,
            "likelihoods have the size of the model"
        );
        let at = Position { line: 1, column: 1 };
        let successors = transitions.iter().flatten().flatten().map(|(_, p)| p);
        let mut all = start.iter().chain(&likelihoods).chain(successors);
        if let Some(wrong) = all.find(|p| !(0.0..=1.0 + ROW_SUM_TOLERANCE).contains(*p)) {
            let message = format!("{wrong} is no probability, allowed is 0 to 1");
            return Err(ParseError::new(at, message));
        }
        let sparse = transitions.into_iter().map(|rows| {
            let mut sparse = Sparse::default();
            rows.into_iter().for_each(|row| sparse.push(row));
            sparse
        });
        Self::from_parts(Parts {
            discount: self.discount,
            is_cost: self.is_cost,
            states: self.states.clone(),
            actions: self.actions.clone(),
            observations: self.observations.clone(),
            start,
            start_at: at,
            transitions: sparse.collect(),
            observation: likelihoods,
            rewards: self.rewards.clone(),
            row_at: [vec![at; actions * states], vec![at; actions * states]],
            warnings: Vec::new(),
        })
    }

    /// Checks every distribution, and computes what follows from the parts.
    pub(crate) fn from_parts(mut parts: Parts) -> Result<Self, ParseError> {
        let n = parts.states.len();
        let mut told = WarningList {
            warnings: std::mem::take(&mut parts.warnings),
            left_out: 0,
        };
        let start: f64 = parts.start.iter().sum();
        told.check_sum(start, parts.start_at, || "the start belief".to_owned())?;
        let [transition_at, observation_at] = &parts.row_at;
        for (row, at) in transition_at.iter().enumerate() {
            let (action, state) = (row / n, row % n);
            let sum = parts.transitions[action].row(state).iter().map(|e| e.1);
            let name = || parts.row_name("T", action, state);
            told.check_sum(sum.sum(), *at, name)?;
        }
        let sums = observation_sums(&parts.observation, n, parts.observations.len());
        for (row, (at, sum)) in observation_at.iter().zip(&sums).enumerate() {
            told.check_sum(*sum, *at, || parts.row_name("O", row / n, row % n))?;
        }
        let reward = expected_rewards(&parts, &sums);
        let not_finite = reward.iter().position(|r| !r.is_finite());
        if let Some(row) = not_finite {
            let message = format!("{} overflows", parts.row_name("R", row / n, row % n));
            return Err(ParseError::new(parts.start_at, message));
        }
        let joint = Joint::new(&parts.transitions, &parts.observation, n);
        let mut model = Self {
            discount: parts.discount,
            is_cost: parts.is_cost,
            states: parts.states,
            actions: parts.actions,
            observations: parts.observations,
            start: parts.start,
            transitions: parts.transitions,
            observation: parts.observation,
            rewards: parts.rewards,
            reward,
            joint,
            hash: 0,
            warnings: told.warnings(),
        };
        model.hash = hash(&model);
        model.assert_distributions();
        Ok(model)
    }
}

impl Pomdp {
    /// What tracker, bounds and policies rely on. The readers refuse what would break it.
    fn assert_distributions(&self) {
        let n = self.states.len();
        let is_one = |sum: f64| (sum - 1.0).abs() <= ROW_SUM_TOLERANCE;
        for action in 0..self.actions.len() {
            for state in 0..n {
                let row = self.successors(state, action);
                assert!(
                    row.iter().all(|(_, p)| *p >= 0.0) && is_one(row.iter().map(|e| e.1).sum()),
                    "row {state} of T under action {action} is a distribution: {row:?}"
                );
            }
        }
        assert!(
            self.observation.iter().all(|p| *p >= 0.0),
            "Z holds no negative number"
        );
        let sums = observation_sums(&self.observation, n, self.observations.len());
        let wrong = sums.iter().find(|sum| !is_one(**sum));
        assert!(wrong.is_none(), "rows of Z sum to 1: {wrong:?}");
        let start: f64 = self.start.iter().sum();
        assert!(
            self.start.iter().all(|p| *p >= 0.0) && is_one(start),
            "the start belief is a distribution: {start}"
        );
    }
}

impl Parts {
    fn row_name(&self, table: &str, action: usize, state: usize) -> String {
        format!("{table}: {} : {}", self.actions[action], self.states[state])
    }
}

/// Refuses what cannot be a distribution; `name` says which.
pub(crate) fn refuse_sum(
    sum: f64,
    at: Position,
    name: impl Fn() -> String,
) -> Result<(), ParseError> {
    if (sum - 1.0).abs() <= ROW_SUM_TOLERANCE {
        return Ok(());
    }
    let allowed = format!("allowed is 1 within {ROW_SUM_TOLERANCE}");
    let message = format!("{} sums to {sum}, not to 1; {allowed}", name());
    Err(ParseError::new(at, message))
}

/// Warnings so far.
struct WarningList {
    warnings: Vec<Warning>,
    left_out: usize,
}

impl WarningList {
    fn check_sum(
        &mut self,
        sum: f64,
        at: Position,
        name: impl Fn() -> String,
    ) -> Result<(), ParseError> {
        let error = (sum - 1.0).abs();
        if error <= ROW_SUM_WARNING {
            return Ok(());
        }
        refuse_sum(sum, at, &name)?;
        if self.warnings.len() < WARNINGS_MAX {
            let message = format!("{} sums to {sum}, not to 1", name());
            self.warnings.push(Warning { at, message });
        } else {
            self.left_out += 1;
        }
        Ok(())
    }

    fn warnings(mut self) -> Vec<Warning> {
        if let (Some(last), 1..) = (self.warnings.last(), self.left_out) {
            let at = last.at;
            let message = format!("and {} more rows do not sum to 1", self.left_out);
            self.warnings.push(Warning { at, message });
        }
        self.warnings
    }
}

/// sum_z Z(a,s',z) for every (a, s').
fn observation_sums(likelihoods: &[f64], n: usize, observations: usize) -> Vec<f64> {
    let mut sums = vec![0.0; likelihoods.len() / observations];
    for (row, column) in likelihoods.chunks(n).enumerate() {
        let action = row / observations;
        for (sum, p) in sums[action * n..][..n].iter_mut().zip(column) {
            *sum += p;
        }
    }
    sums
}

/// R(s,a) = sum over s' and z of T(s,a,s') Z(a,s',z) R(s,a,s',z).
fn expected_rewards(parts: &Parts, observation_sums: &[f64]) -> Vec<f64> {
    let (n, k) = (parts.states.len(), parts.observations.len());
    let mut reward = Vec::with_capacity(observation_sums.len());
    for (a, sparse) in parts.transitions.iter().enumerate() {
        for s in 0..n {
            let block = parts.rewards.block(s, a);
            let mut sum = 0.0;
            for &(to, p) in sparse.row(s) {
                let (mut inner, mut rest) = (0.0, observation_sums[a * n + to]);
                for &(_, z, r) in block.others_at(to) {
                    let likelihood = parts.observation[(a * k + z as usize) * n + to];
                    inner += likelihood * r;
                    rest -= likelihood;
                }
                inner += rest * block.rest;
                sum += p * inner;
            }
            // Never a negative zero.
            reward.push(sum + 0.0);
        }
    }
    reward
}

#[cfg(test)]
mod tests {
    use super::*;

    const COIN: &str = "discount: 0.9\nvalues: reward\nstates: heads tails\nactions: toss\n\
        observations: bright dark\nT: toss uniform\nO: toss\n0.75 0.25\n0.25 0.75\n";

    fn broken(by: impl FnOnce(&mut Pomdp)) {
        let mut model = Pomdp::parse(COIN).unwrap();
        model.assert_distributions();
        by(&mut model);
        model.assert_distributions();
    }

    #[test]
    #[should_panic(expected = "row 1 of T under action 0 is a distribution")]
    fn a_row_that_does_not_sum_to_one_is_caught() {
        broken(|model| {
            model.transitions[0] = Sparse::default();
            model.transitions[0].push(vec![(0, 0.5), (1, 0.5)]);
            model.transitions[0].push(vec![(0, 0.5), (1, 0.4)]);
        });
    }

    #[test]
    #[should_panic(expected = "rows of Z sum to 1: Some(1.25)")]
    fn a_row_of_observations_that_does_not_sum_to_one_is_caught() {
        broken(|model| model.observation[0] = 1.0);
    }

    #[test]
    #[should_panic(expected = "Z holds no negative number")]
    fn a_negative_number_in_a_row_that_sums_to_one_is_caught() {
        broken(|model| (model.observation[0], model.observation[2]) = (1.5, -0.5));
    }

    #[test]
    #[should_panic(expected = "the start belief is a distribution")]
    fn a_start_belief_that_does_not_sum_to_one_is_caught() {
        broken(|model| model.start[0] = 0.6);
    }

    #[test]
    fn probabilities_from_elsewhere_that_are_none_are_refused() {
        let model = Pomdp::parse(COIN).unwrap();
        let good = Probabilities {
            start: vec![0.5, 0.5],
            transitions: vec![vec![vec![(0, 0.5), (1, 0.5)]; 2]],
            likelihoods: vec![0.75, 0.25, 0.25, 0.75],
        };
        assert_eq!(model.with_probabilities(good.clone()), Ok(model.clone()));
        let refused = |change: &dyn Fn(&mut Probabilities)| {
            let mut wrong = good.clone();
            change(&mut wrong);
            model.with_probabilities(wrong).unwrap_err().message
        };
        let negative = refused(&|p| p.start = vec![1.5, -0.5]);
        assert_eq!(negative, "1.5 is no probability, allowed is 0 to 1");
        assert!(refused(&|p| p.likelihoods[1] = f64::NAN).starts_with("NaN is no"));
        assert!(refused(&|p| p.transitions[0][0][1].1 = -0.1).starts_with("-0.1 is no"));
    }
}
