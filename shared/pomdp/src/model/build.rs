//! From what a reader has collected to a model: rows are checked, expected rewards computed.

use super::distribution::{RowSum, SUM_TOLERANCE, check_probability};
use super::goals::Goals;
use super::hash::hash;
use super::joint::Joint;
use super::rewards::Rewards;
use super::sparse::Sparse;
use super::{Pomdp, Warning};
use crate::parse_error::{ParseError, Position};

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
        for p in start.iter().chain(&likelihoods).chain(successors) {
            check_probability(*p).map_err(|message| ParseError::new(at, message))?;
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

    /// Mends or refuses every row that is no distribution, and computes what follows from the
    /// parts.
    pub(crate) fn from_parts(mut parts: Parts) -> Result<Self, ParseError> {
        let n = parts.states.len();
        let warnings = parts.mend()?;
        let sums = observation_sums(&parts.observation, n, parts.observations.len());
        let reward = expected_rewards(&parts, &sums);
        let not_finite = reward.iter().position(|r| !r.is_finite());
        if let Some(row) = not_finite {
            let message = format!("{} overflows", parts.row_name("R", row / n, row % n));
            return Err(ParseError::new(parts.start_at, message));
        }
        let goals = (parts.discount >= 1.0).then(|| Goals::new(&parts.transitions, &reward, n));
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
            goals,
            joint,
            hash: 0,
            warnings,
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
        let is_one = |sum: f64| (sum - 1.0).abs() <= SUM_TOLERANCE;
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
    /// Divides rows that are slightly off by their sums; returns what is to be told.
    fn mend(&mut self) -> Result<Vec<Warning>, ParseError> {
        let (n, k) = (self.states.len(), self.observations.len());
        let mut told = WarningList {
            warnings: std::mem::take(&mut self.warnings),
            left_out: 0,
        };
        let sum = self.start.iter().sum();
        let factor = told.judge(sum, self.start_at, || "the start belief".to_owned())?;
        self.start.iter_mut().for_each(|p| *p *= factor);
        for row in 0..self.row_at[0].len() {
            let (action, state) = (row / n, row % n);
            let sum = self.transitions[action].row(state).iter().map(|e| e.1);
            let name = || self.row_name("T", action, state);
            let factor = told.judge(sum.sum(), self.row_at[0][row], name)?;
            self.transitions[action].scale(state, factor);
        }
        let sums = observation_sums(&self.observation, n, k);
        for (row, at) in self.row_at[1].iter().enumerate() {
            let (action, state) = (row / n, row % n);
            let name = || self.row_name("O", action, state);
            let factor = told.judge(sums[row], *at, name)?;
            for z in 0..k {
                self.observation[(action * k + z) * n + state] *= factor;
            }
        }
        Ok(told.warnings())
    }

    fn row_name(&self, table: &str, action: usize, state: usize) -> String {
        format!("{table}: {} : {}", self.actions[action], self.states[state])
    }
}

/// Warnings so far.
struct WarningList {
    warnings: Vec<Warning>,
    left_out: usize,
}

impl WarningList {
    /// The factor that makes a row's sum 1; `name` says which row.
    fn judge(
        &mut self,
        sum: f64,
        at: Position,
        name: impl Fn() -> String,
    ) -> Result<f64, ParseError> {
        let wrong = |problem: String| ParseError::new(at, format!("{} {problem}", name()));
        let judged = RowSum::new(sum).map_err(wrong)?;
        if let Some(warning) = judged.warning() {
            if self.warnings.len() < WARNINGS_MAX {
                let message = format!("{} {warning}", name());
                self.warnings.push(Warning { at, message });
            } else {
                self.left_out += 1;
            }
        }
        Ok(judged.factor())
    }

    fn warnings(mut self) -> Vec<Warning> {
        if let (Some(last), 1..) = (self.warnings.last(), self.left_out) {
            let at = last.at;
            let message = format!("and {} more rows that do not sum to 1", self.left_out);
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
    fn rows_that_were_rounded_are_mended_and_stay_so() {
        let third = "T: toss\n0.333333 0.666666\n0.5 0.5\n";
        let text = COIN.replace("T: toss uniform\n", third);
        let text = text.replace("dark\n", "dark\nstart: 0.25 0.750004\n");
        let text = text.replace("0.25 0.75\n", "0.25 0.750008\n");
        let model = Pomdp::parse(&text).unwrap();
        let row = model.successors(0, 0);
        assert!((row[0].1 - 1.0 / 3.0).abs() < 1e-15 && (row[1].1 - 2.0 / 3.0).abs() < 1e-15);
        assert!((model.start()[0] - 0.25 / 1.000_004).abs() < 1e-15);
        assert!((model.likelihood(0, 1)[1] - 0.750_008 / 1.000_008).abs() < 1e-15);
        let told: Vec<&str> = model.warnings().iter().map(|w| &*w.message).collect();
        assert!(told[0].starts_with("the start belief sums to 1.000004"));
        assert!(told[1].starts_with("T: toss : heads sums to 0.999999"));
        assert!(told[2].starts_with("O: toss : tails sums to 1.000008"));
        assert!(told.len() == 3 && told[2].ends_with("not to 1; it was divided by that"));
        let wrong = text.replace("0.666666", "0.666646");
        let wrong = Pomdp::parse(&wrong).unwrap_err().message;
        let wanted = "not to 1; allowed is 1 within 0.00001";
        assert!(wrong.starts_with("T: toss : heads sums to 0.999979") && wrong.ends_with(wanted));
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
