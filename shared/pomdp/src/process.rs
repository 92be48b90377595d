//! Models in code: for a world that is easier to compute than to list.

use std::collections::HashSet;

use crate::model::rewards::{Block, BlockSize, Rewards};
use crate::model::sparse::Sparse;
use crate::model::{Parts, Pomdp, RowSum, check_probability};
use crate::parse_error::Position;
use crate::reader::is_reserved;

/// A decision process, given by functions of indices. States, actions and observations are numbered
/// as their names are.
///
/// ```
/// use vigil_pomdp::{Process, Pomdp};
///
/// /// A lamp that fails; a look is right nine times in ten.
/// struct Lamp;
///
/// impl Process for Lamp {
///     fn discount(&self) -> f64 {
///         0.95
///     }
///     fn states(&self) -> Vec<String> {
///         ["lit", "dark"].map(str::to_owned).to_vec()
///     }
///     fn actions(&self) -> Vec<String> {
///         ["look", "replace"].map(str::to_owned).to_vec()
///     }
///     fn observations(&self) -> Vec<String> {
///         ["bright", "dim"].map(str::to_owned).to_vec()
///     }
///     fn start(&self) -> Vec<(usize, f64)> {
///         vec![(0, 1.0)]
///     }
///     fn transition(&self, state: usize, action: usize) -> Vec<(usize, f64)> {
///         match (state, action) {
///             (_, 1) => vec![(0, 1.0)],
///             (0, _) => vec![(0, 0.9), (1, 0.1)],
///             _ => vec![(1, 1.0)],
///         }
///     }
///     fn observation(&self, _: usize, next: usize) -> Vec<(usize, f64)> {
///         vec![(next, 0.9), (1 - next, 0.1)]
///     }
///     fn reward(&self, state: usize, action: usize) -> f64 {
///         [1.0, -1.0][state] - 2.0 * action as f64
///     }
/// }
///
/// let model = Pomdp::from_process(&Lamp)?;
/// assert_eq!(model.successors(0, 0), [(0, 0.9), (1, 0.1)]);
/// # Ok::<(), vigil_pomdp::ProcessError>(())
/// ```
pub trait Process {
    /// Weight of the next step against this one, 0 to 1.
    fn discount(&self) -> f64;

    /// Names of the states: a letter, then letters, digits, `-` and `_`.
    fn states(&self) -> Vec<String>;

    /// Names of the actions.
    fn actions(&self) -> Vec<String>;

    /// Names of the observations; without any the state is known, and the model an MDP.
    fn observations(&self) -> Vec<String>;

    /// The states in which it may begin, with their probabilities.
    fn start(&self) -> Vec<(usize, f64)>;

    /// The states that may follow, with T(s,a,s').
    fn transition(&self, state: usize, action: usize) -> Vec<(usize, f64)>;

    /// What may be observed in the `next` state, with Z(a,s',z). Not asked for an MDP.
    fn observation(&self, action: usize, next: usize) -> Vec<(usize, f64)>;

    /// R(s,a), expected.
    fn reward(&self, state: usize, action: usize) -> f64;
}

/// Why a process is no model.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum ProcessError {
    /// A discount that is none.
    #[error("the discount is {0}, allowed is 0 to 1")]
    Discount(f64),
    /// No names, or one that is not allowed or appears twice.
    #[error("{what}: {problem}")]
    Names {
        /// `states`, `actions` or `observations`.
        what: &'static str,
        /// What is wrong.
        problem: String,
    },
    /// A row that is no distribution.
    #[error("{row}: {problem}")]
    Row {
        /// The start, or T or Z with its action and state.
        row: String,
        /// What is wrong.
        problem: String,
    },
    /// A reward that is not finite.
    #[error("R({state}, {action}) is {reward}")]
    Reward {
        /// Name of the state.
        state: String,
        /// Name of the action.
        action: String,
        /// What it is.
        reward: f64,
    },
}

impl Pomdp {
    /// The model of a process, each of whose functions is asked once for each of its arguments.
    /// What a row lists twice is added up.
    ///
    /// # Errors
    /// [`ProcessError`], naming the row.
    pub fn from_process(process: &impl Process) -> Result<Self, ProcessError> {
        let discount = process.discount();
        if !(0.0..=1.0).contains(&discount) {
            return Err(ProcessError::Discount(discount));
        }
        let states = names("states", process.states(), 1)?;
        let actions = names("actions", process.actions(), 1)?;
        let mut observations = names("observations", process.observations(), 0)?;
        let is_mdp = observations.is_empty();
        if is_mdp {
            observations.push("none".to_owned());
        }
        let (n, k) = (states.len(), observations.len());
        let start = dense(process.start(), n, || "the start".to_owned())?;
        let (mut transitions, mut observation) = (Vec::new(), Vec::new());
        let (mut blocks, size) = (
            Vec::new(),
            BlockSize {
                next: n,
                observations: k,
            },
        );
        for (a, action) in actions.iter().enumerate() {
            let mut rows = Sparse::default();
            let mut columns = vec![0.0; k * n];
            for (s, state) in states.iter().enumerate() {
                let name = |table: &str| format!("{table} of {action} in {state}");
                let row = dense(process.transition(s, a), n, || name("T"))?;
                rows.push(row.into_iter().enumerate().filter(|(_, p)| *p > 0.0));
                let seen = match is_mdp {
                    true => vec![(0, 1.0)],
                    false => process.observation(a, s),
                };
                for (z, p) in dense(seen, k, || name("Z"))?.into_iter().enumerate() {
                    columns[z * n + s] = p;
                }
                let reward = process.reward(s, a);
                finite(reward, state, action)?;
                blocks.push(Block::new(size, reward, Vec::new()));
            }
            transitions.push(rows);
            observation.extend(columns);
        }
        let of: Vec<u32> = (0..blocks.len() as u32).collect();
        let at = Position { line: 1, column: 1 };
        let rows = actions.len() * n;
        Self::from_parts(Parts {
            discount,
            is_cost: false,
            rewards: Rewards::new(n, &of, blocks),
            states,
            actions,
            observations,
            start,
            start_at: at,
            transitions,
            observation,
            row_at: [vec![at; rows], vec![at; rows]],
            warnings: Vec::new(),
        })
        .map_err(|error| ProcessError::Row {
            row: "the model".to_owned(),
            problem: error.message,
        })
    }
}

fn finite(reward: f64, state: &str, action: &str) -> Result<(), ProcessError> {
    let refused = || ProcessError::Reward {
        state: state.to_owned(),
        action: action.to_owned(),
        reward,
    };
    reward.is_finite().then_some(()).ok_or_else(refused)
}

fn names(
    what: &'static str,
    names: Vec<String>,
    least: usize,
) -> Result<Vec<String>, ProcessError> {
    let wrong = |problem: String| Err(ProcessError::Names { what, problem });
    if names.len() < least {
        return wrong("none, allowed is one or more".to_owned());
    }
    let mut seen = HashSet::with_capacity(names.len());
    for name in &names {
        let word = |c: char| c.is_ascii_alphanumeric() || c == '-' || c == '_';
        let begins = name.starts_with(|c: char| c.is_ascii_alphabetic());
        if !begins || !name.chars().all(word) || is_reserved(name) {
            return wrong(format!(
                "'{name}', allowed is a letter, then letters, digits, '-' and '_', and no word of \
                 the file format"
            ));
        }
        if !seen.insert(name.as_str()) {
            return wrong(format!("'{name}' appears twice"));
        }
    }
    Ok(names)
}

/// A distribution over `width` places.
fn dense(
    entries: Vec<(usize, f64)>,
    width: usize,
    name: impl Fn() -> String,
) -> Result<Vec<f64>, ProcessError> {
    let wrong = |problem: String| ProcessError::Row {
        row: name(),
        problem,
    };
    let mut row = vec![0.0; width];
    for (at, p) in entries {
        check_probability(p).map_err(wrong)?;
        let place = row.get_mut(at);
        let missing = || wrong(format!("index {at}, allowed is 0 to {}", width - 1));
        *place.ok_or_else(missing)? += p;
    }
    RowSum::new(row.iter().sum()).map_err(wrong)?;
    Ok(row)
}
