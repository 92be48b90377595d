//! All probabilities of a model in one list, row after row, without what the model rules out.

use std::ops::Range;

use vigil_pomdp::model::Probabilities;
use vigil_pomdp::{ParseError, Pomdp};

/// Which probabilities a row holds.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Table {
    /// The start belief.
    Start,
    /// T(s,a,.).
    Transition,
    /// Z(a,s',.).
    Observation,
}

/// A row.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Row {
    /// Its table.
    pub table: Table,
    /// Its action; 0 for the start belief.
    pub action: usize,
    /// s of T, s' of Z; 0 for the start belief.
    pub state: usize,
}

impl Row {
    /// What `model` says of a column: s of the start belief, s' of T, z of Z.
    ///
    /// # Panics
    /// For a row or column that the model does not have.
    #[must_use]
    pub fn p(&self, model: &Pomdp, column: usize) -> f64 {
        match self.table {
            Table::Start => model.start()[column],
            Table::Transition => {
                let row = model.successors(self.state, self.action).iter();
                row.filter(|e| e.0 == column).map(|e| e.1).sum()
            }
            Table::Observation => model.likelihood(self.action, column)[self.state],
        }
    }
}

/// Marks an observation that is ruled out.
const NONE: u32 = u32::MAX;

/// Where each probability stands. Row 0 is the start belief, then T by action and state, then Z.
#[derive(Debug, Clone)]
pub(super) struct Layout {
    pub states: usize,
    actions: usize,
    observations: usize,
    /// Where each row begins, and the end.
    starts: Vec<u32>,
    /// s, s' or z of each probability.
    pub columns: Vec<u32>,
    /// Place of Z(a,s',z) at (a * observations + z) * states + s', or [`NONE`].
    observation_at: Vec<u32>,
}

impl Layout {
    /// The layout of a model, and the model's probabilities in it.
    pub(super) fn new(model: &Pomdp) -> (Self, Vec<f64>) {
        let (n, k) = (model.states().len(), model.observations().len());
        let actions = model.actions().len();
        let mut layout = Self {
            states: n,
            actions,
            observations: k,
            starts: vec![0],
            columns: Vec::new(),
            observation_at: vec![NONE; actions * k * n],
        };
        let mut values = Vec::new();
        layout.push(&mut values, model.start().iter().copied().enumerate());
        for action in 0..actions {
            for state in 0..n {
                let row = model.successors(state, action).iter().copied();
                layout.push(&mut values, row);
            }
        }
        for action in 0..actions {
            for state in 0..n {
                let row = (0..k).map(|z| (z, model.likelihood(action, z)[state]));
                let range = layout.push(&mut values, row);
                for at in range {
                    let z = layout.columns[at] as usize;
                    layout.observation_at[(action * k + z) * n + state] = at as u32;
                }
            }
        }
        (layout, values)
    }

    fn push(
        &mut self,
        values: &mut Vec<f64>,
        row: impl Iterator<Item = (usize, f64)>,
    ) -> Range<usize> {
        let first = values.len();
        for (column, p) in row.filter(|(_, p)| *p > 0.0) {
            self.columns.push(column as u32);
            values.push(p);
        }
        self.starts.push(values.len() as u32);
        first..values.len()
    }

    /// Places of each row.
    pub(super) fn rows(&self) -> impl Iterator<Item = Range<usize>> + '_ {
        let pairs = self.starts.windows(2);
        pairs.map(|pair| pair[0] as usize..pair[1] as usize)
    }

    /// Which row the `index`-th is.
    pub(super) fn row(&self, index: usize) -> Row {
        let all = self.actions * self.states;
        let (table, rest) = match index.checked_sub(1) {
            None => (Table::Start, 0),
            Some(rest) if rest < all => (Table::Transition, rest),
            Some(rest) => (Table::Observation, rest - all),
        };
        Row {
            table,
            action: rest / self.states,
            state: rest % self.states,
        }
    }

    /// Places of the start belief.
    pub(super) fn start(&self) -> Range<usize> {
        0..self.starts[1] as usize
    }

    /// Places of T(s,a,.).
    pub(super) fn transition(&self, action: usize, state: usize) -> Range<usize> {
        let row = 1 + action * self.states + state;
        self.starts[row] as usize..self.starts[row + 1] as usize
    }

    /// Places of Z(a,s',z) for every s': [`Self::value`].
    pub(super) fn observation(&self, action: usize, observation: usize) -> &[u32] {
        let first = (action * self.observations + observation) * self.states;
        &self.observation_at[first..first + self.states]
    }

    /// The probability at a place; 0 if it is ruled out.
    pub(super) fn value(values: &[f64], at: u32) -> f64 {
        values.get(at as usize).copied().unwrap_or(0.0)
    }

    /// `model` with other probabilities.
    ///
    /// # Errors
    /// [`ParseError`] if rewards overflow; rows must be distributions.
    pub(super) fn model(&self, model: &Pomdp, values: &[f64]) -> Result<Pomdp, ParseError> {
        let mut start = vec![0.0; self.states];
        for at in self.start() {
            start[self.columns[at] as usize] = values[at];
        }
        let row = |action, state| {
            let places = self.transition(action, state);
            let entries = places.map(|at| (self.columns[at] as usize, values[at]));
            entries.collect()
        };
        let rows = |action| (0..self.states).map(|state| row(action, state)).collect();
        let likelihoods = self.observation_at.iter();
        model.with_probabilities(Probabilities {
            start,
            transitions: (0..self.actions).map(rows).collect(),
            likelihoods: likelihoods.map(|&at| Self::value(values, at)).collect(),
        })
    }
}
