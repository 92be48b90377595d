//! Compressed sparse rows.

/// Rows of (column, value); columns ascend and no value is 0.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Sparse {
    starts: Vec<usize>,
    entries: Vec<(usize, f64)>,
}

impl Default for Sparse {
    fn default() -> Self {
        Self {
            starts: vec![0],
            entries: Vec::new(),
        }
    }
}

impl Sparse {
    /// The row; its columns ascend.
    pub(crate) fn row(&self, row: usize) -> &[(usize, f64)] {
        &self.entries[self.starts[row]..self.starts[row + 1]]
    }

    /// Number of rows.
    pub(crate) fn rows(&self) -> usize {
        self.starts.len() - 1
    }

    /// Number of entries.
    pub(crate) fn len(&self) -> usize {
        self.entries.len()
    }

    /// Multiplies a row.
    pub(crate) fn scale(&mut self, row: usize, factor: f64) {
        let entries = &mut self.entries[self.starts[row]..self.starts[row + 1]];
        entries.iter_mut().for_each(|(_, value)| *value *= factor);
    }

    /// Adds a row; columns must ascend. What is 0 is left out.
    pub(crate) fn push(&mut self, row: impl IntoIterator<Item = (usize, f64)>) {
        let some = row.into_iter().filter(|(_, value)| *value != 0.0);
        self.entries.extend(some);
        self.starts.push(self.entries.len());
    }
}
