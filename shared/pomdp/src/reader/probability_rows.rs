//! Rows of T and O from their rules.

use super::limits::{self, ENTRIES_MAX};
use super::replay::Rules;
use crate::model::RowSum;
use crate::model::sparse::Sparse;
use crate::parse_error::{ParseError, Position};

/// What a rule writes into a row of probabilities.
#[derive(Debug)]
pub(super) enum Fill {
    /// One entry, or all alike.
    One(Option<usize>, f64),
    /// The whole row: these, 0 elsewhere.
    Row(Vec<(usize, f64)>),
    /// The whole row, equal.
    Uniform,
    /// The state itself.
    Identity,
    /// The start belief.
    Reset,
    /// The whole row: that of the matrix.
    Matrix(Sparse),
}

impl Fill {
    /// At most so many entries are written into a row.
    pub(super) fn entries(&self, width: usize) -> usize {
        match self {
            Self::One(Some(_), _) | Self::Identity => 1,
            Self::One(None, _) | Self::Uniform | Self::Reset => width,
            Self::Row(row) => row.len(),
            // On average over the rows, all of which are covered unless a state is fixed.
            Self::Matrix(matrix) => matrix.len().div_ceil(matrix.rows().max(1)),
        }
    }
}

/// A row while it is written: dense, with a list of what was touched.
struct Row {
    values: Vec<f64>,
    is_touched: Vec<bool>,
    touched: Vec<usize>,
}

impl Row {
    fn new(width: usize) -> Self {
        Self {
            values: vec![0.0; width],
            is_touched: vec![false; width],
            touched: Vec::new(),
        }
    }

    fn set(&mut self, column: usize, value: f64) {
        self.values[column] = value;
        if !self.is_touched[column] {
            self.is_touched[column] = true;
            self.touched.push(column);
        }
    }

    fn set_all(&mut self, value: f64) {
        for column in 0..self.values.len() {
            self.set(column, value);
        }
    }

    fn clear(&mut self) {
        for column in self.touched.drain(..) {
            self.values[column] = 0.0;
            self.is_touched[column] = false;
        }
    }

    fn replace(&mut self, entries: &[(usize, f64)]) {
        self.clear();
        for &(column, value) in entries {
            self.set(column, value);
        }
    }

    fn apply(&mut self, fill: &Fill, state: usize, start: &[(usize, f64)]) {
        match fill {
            Fill::One(Some(column), value) => self.set(*column, *value),
            Fill::One(None, value) => self.set_all(*value),
            Fill::Row(row) => self.replace(row),
            Fill::Uniform => self.set_all(1.0 / self.values.len() as f64),
            Fill::Identity => self.replace(&[(state, 1.0)]),
            Fill::Reset => self.replace(start),
            Fill::Matrix(matrix) => self.replace(matrix.row(state)),
        }
    }

    /// What is not 0; columns ascend.
    fn entries(&mut self) -> impl Iterator<Item = (usize, f64)> {
        self.touched.sort_unstable();
        self.touched
            .iter()
            .map(|&column| (column, self.values[column]))
            .filter(|(_, value)| *value > 0.0)
    }
}

/// Calls `row(action, state, entries)` for every row; returns where each was last written.
fn rows(
    rules: &Rules<Fill>,
    width: usize,
    start: &[f64],
    mut keep: impl FnMut(usize, usize, &mut Row, Position) -> Result<(), ParseError>,
) -> Result<Vec<Position>, ParseError> {
    let start: Vec<(usize, f64)> = start.iter().copied().enumerate().collect();
    let start: Vec<(usize, f64)> = start.into_iter().filter(|(_, p)| *p > 0.0).collect();
    let mut row = Row::new(width);
    let mut written_at = Vec::with_capacity(rules.actions * rules.states);
    rules.play(|action, state, numbers| {
        row.clear();
        for &number in numbers {
            row.apply(&rules.rule(number).fill, state, &start);
        }
        let at = numbers.last().map_or(rules.at, |&n| rules.rule(n).at);
        written_at.push(at);
        keep(action, state, &mut row, at)
    })?;
    Ok(written_at)
}

/// T, per action, and where each row was written. `name` is that of a row: the first that is no
/// distribution ends the reading, before more work goes into the model.
pub(super) fn transitions(
    rules: &Rules<Fill>,
    start: &[f64],
    name: impl Fn(usize, usize) -> String,
) -> Result<(Vec<Sparse>, Vec<Position>), ParseError> {
    let mut all: Vec<Sparse> = Vec::with_capacity(rules.actions);
    let mut kept = 0;
    let at = rows(rules, rules.states, start, |action, state, row, at| {
        let sum = row.entries().map(|(_, p)| p).sum();
        let wrong = |problem| ParseError::new(at, format!("{} {problem}", name(action, state)));
        RowSum::new(sum).map_err(wrong)?;
        if all.len() == action {
            all.push(Sparse::default());
        }
        if let Some(sparse) = all.last_mut() {
            let before = sparse.len();
            sparse.push(row.entries());
            kept += sparse.len() - before;
        }
        limits::check(Some(kept), ENTRIES_MAX, at, "T entries other than 0")
    })?;
    Ok((all, at))
}

/// Z[a][z][s'], and where each row (a, s') was written.
pub(super) fn observations(
    rules: &Rules<Fill>,
    observations: usize,
) -> Result<(Vec<f64>, Vec<Position>), ParseError> {
    let n = rules.states;
    let mut table = vec![0.0; rules.actions * observations * n];
    let at = rows(rules, observations, &[], |action, state, row, _| {
        for (z, p) in row.entries() {
            table[(action * observations + z) * n + state] = p;
        }
        Ok(())
    })?;
    Ok((table, at))
}
