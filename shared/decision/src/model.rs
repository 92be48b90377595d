//! A POMDP in the form that tracking and deciding need: sparse transitions, dense columns of Z.

use vigil_blocks::fnv1a;

use crate::reader::{self, ParseError, Position};

/// Row sums may differ from 1 by this much; beyond it the model is refused.
const ROW_SUM_TOLERANCE: f64 = 1e-5;
/// Row sums that differ from 1 by more than this are worth a warning.
const ROW_SUM_WARNING: f64 = 1e-9;

/// Something about a model that its author may want to mend.
#[derive(Debug, Clone, PartialEq)]
pub struct Warning {
    /// Where.
    pub at: Position,
    /// What.
    pub message: String,
}

/// A partially observable Markov decision process.
#[derive(Debug, Clone, PartialEq)]
pub struct Pomdp {
    discount: f64,
    states: Vec<String>,
    actions: Vec<String>,
    observations: Vec<String>,
    start: Vec<f64>,
    /// Per action, compressed sparse rows: for each s the successors and their probabilities.
    transitions: Vec<Sparse>,
    /// Z[a][z][s'].
    observation: Vec<f64>,
    /// R[a][s].
    reward: Vec<f64>,
    hash: u64,
    warnings: Vec<Warning>,
}

/// Compressed sparse rows of one action's transitions.
#[derive(Debug, Clone, PartialEq, Default)]
pub(crate) struct Sparse {
    starts: Vec<usize>,
    entries: Vec<(usize, f64)>,
}

impl Sparse {
    /// Successors of state `s` and their probabilities.
    pub(crate) fn row(&self, s: usize) -> &[(usize, f64)] {
        &self.entries[self.starts[s]..self.starts[s + 1]]
    }
}

/// What the reader has collected; tables are dense.
pub(crate) struct Parts {
    pub discount: f64,
    pub states: Vec<String>,
    pub actions: Vec<String>,
    pub observations: Vec<String>,
    pub start: Vec<f64>,
    /// T[a][s][s'].
    pub transition: Vec<f64>,
    /// O[a][s'][z].
    pub observation: Vec<f64>,
    /// R[a][s][s'][z].
    pub reward: Vec<f64>,
    /// 1 for rewards, -1 for costs.
    pub reward_sign: f64,
    /// Where row (a, s) of T and of O was written.
    pub row_at: [Vec<Position>; 2],
}

impl Pomdp {
    /// Reads Cassandra's `.pomdp` format.
    ///
    /// # Errors
    /// [`ParseError`] with line and column, what was found and what is allowed.
    pub fn parse(text: &str) -> Result<Self, ParseError> {
        reader::parse(text)
    }

    pub(crate) fn from_parts(parts: Parts) -> Result<Self, ParseError> {
        let (n, k) = (parts.states.len(), parts.observations.len());
        let mut warnings = Vec::new();
        check_rows(
            &parts,
            ("T", &parts.transition, n, &parts.row_at[0]),
            &mut warnings,
        )?;
        check_rows(
            &parts,
            ("O", &parts.observation, k, &parts.row_at[1]),
            &mut warnings,
        )?;
        let transitions: Vec<Sparse> = parts
            .transition
            .chunks(n * n)
            .map(|matrix| sparse(matrix, n))
            .collect();
        let mut observation = vec![0.0; parts.observation.len()];
        for (row, chunk) in parts.observation.chunks(k).enumerate() {
            let (action, state) = (row / n, row % n);
            for (z, p) in chunk.iter().enumerate() {
                observation[(action * k + z) * n + state] = *p;
            }
        }
        let reward = expected_rewards(&parts, &transitions);
        let mut model = Self {
            discount: parts.discount,
            states: parts.states,
            actions: parts.actions,
            observations: parts.observations,
            start: parts.start,
            transitions,
            observation,
            reward,
            hash: 0,
            warnings,
        };
        model.hash = model.compute_hash();
        Ok(model)
    }

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

    /// Start belief.
    #[must_use]
    pub fn start(&self) -> &[f64] {
        &self.start
    }

    /// R(s,a), the expected immediate reward; costs count negative.
    #[must_use]
    pub fn reward(&self, state: usize, action: usize) -> f64 {
        self.reward[action * self.states.len() + state]
    }

    /// Successors of `state` under `action`: (s', probability).
    #[must_use]
    pub fn successors(&self, state: usize, action: usize) -> &[(usize, f64)] {
        self.transitions[action].row(state)
    }

    /// Z(a,s',z) for every s'.
    #[must_use]
    pub fn likelihood(&self, action: usize, observation: usize) -> &[f64] {
        let n = self.states.len();
        let first = (action * self.observations.len() + observation) * n;
        &self.observation[first..first + n]
    }

    /// Hash over everything that has a meaning: numbers and names, not comments or layout.
    #[must_use]
    pub const fn hash(&self) -> u64 {
        self.hash
    }

    /// What the author may want to mend.
    #[must_use]
    pub fn warnings(&self) -> &[Warning] {
        &self.warnings
    }

    fn compute_hash(&self) -> u64 {
        let mut hash = fnv1a::hash_u64(fnv1a::BASIS, self.discount.to_bits());
        for names in [&self.states, &self.actions, &self.observations] {
            hash = fnv1a::hash_u64(hash, names.len() as u64);
            for name in names {
                hash = fnv1a::hash(fnv1a::hash(hash, name.as_bytes()), b"\0");
            }
        }
        for sparse in &self.transitions {
            for s in 0..self.states.len() {
                for (to, p) in sparse.row(s) {
                    hash = fnv1a::hash_u64(fnv1a::hash_u64(hash, *to as u64), p.to_bits());
                }
                hash = fnv1a::hash_u64(hash, u64::MAX);
            }
        }
        let numbers = self
            .start
            .iter()
            .chain(&self.observation)
            .chain(&self.reward);
        numbers.fold(hash, |hash, value| fnv1a::hash_u64(hash, value.to_bits()))
    }
}

fn sparse(matrix: &[f64], n: usize) -> Sparse {
    let mut sparse = Sparse {
        starts: vec![0],
        entries: Vec::new(),
    };
    for row in matrix.chunks(n) {
        let some = row.iter().copied().enumerate().filter(|(_, p)| *p > 0.0);
        sparse.entries.extend(some);
        sparse.starts.push(sparse.entries.len());
    }
    sparse
}

/// R(s,a) = sum over s' and z of T(s,a,s') Z(a,s',z) R(s,a,s',z).
fn expected_rewards(parts: &Parts, transitions: &[Sparse]) -> Vec<f64> {
    let (n, k) = (parts.states.len(), parts.observations.len());
    let mut reward = vec![0.0; parts.actions.len() * n];
    for (a, sparse) in transitions.iter().enumerate() {
        for s in 0..n {
            let mut sum = 0.0;
            for &(to, p) in sparse.row(s) {
                let z = &parts.observation[(a * n + to) * k..][..k];
                let r = &parts.reward[((a * n + s) * n + to) * k..][..k];
                sum += p * z.iter().zip(r).map(|(z, r)| z * r).sum::<f64>();
            }
            reward[a * n + s] = parts.reward_sign * sum;
        }
    }
    reward
}

/// Checks that every row of a table is a distribution.
fn check_rows(
    parts: &Parts,
    (name, table, width, row_at): (&str, &[f64], usize, &[Position]),
    warnings: &mut Vec<Warning>,
) -> Result<(), ParseError> {
    let n = parts.states.len();
    for (row, chunk) in table.chunks(width).enumerate() {
        let sum: f64 = chunk.iter().sum();
        let error = (sum - 1.0).abs();
        if error > ROW_SUM_WARNING {
            let (action, state) = (&parts.actions[row / n], &parts.states[row % n]);
            let message = format!("{name}: {action} : {state} sums to {sum}, not to 1");
            if error > ROW_SUM_TOLERANCE {
                let message = format!("{message}; allowed is 1 within {ROW_SUM_TOLERANCE}");
                return Err(ParseError::new(row_at[row], message));
            }
            warnings.push(Warning {
                at: row_at[row],
                message,
            });
        }
    }
    Ok(())
}
