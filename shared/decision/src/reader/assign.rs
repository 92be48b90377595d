//! Assignments to the dense tables of a POMDP while it is read.

use super::{ParseError, Position};

/// Most entries of one table; a model beyond that is refused before memory is taken.
const ENTRIES_MAX: usize = 1 << 26;

/// A dense table with up to four dimensions, and where each row was last written.
#[derive(Debug)]
pub(super) struct Table {
    pub shape: Vec<usize>,
    pub values: Vec<f64>,
}

/// An index that is fixed, or all of them.
pub(super) type Pick = Option<usize>;

impl Table {
    pub(super) fn new(shape: &[usize], what: &str, at: Position) -> Result<Self, ParseError> {
        let entries = shape.iter().try_fold(1_usize, |n, &d| n.checked_mul(d));
        match entries {
            Some(n) if n <= ENTRIES_MAX => Ok(Self {
                shape: shape.to_vec(),
                values: vec![0.0; n],
            }),
            _ => {
                let sizes: Vec<String> = shape.iter().map(ToString::to_string).collect();
                let sizes = sizes.join(" x ");
                let message = format!("{what} has {sizes} entries, allowed are {ENTRIES_MAX}");
                Err(ParseError::new(at, message))
            }
        }
    }

    /// Writes `value(last index)` wherever `picks` says; dimensions beyond the picks are all
    /// written. Returns nothing; later writes win.
    pub(super) fn write(&mut self, picks: &[Pick], value: impl Fn(&[usize]) -> f64) {
        let mut index = vec![0; self.shape.len()];
        self.write_from(0, picks, &mut index, 0, &value);
    }

    fn write_from(
        &mut self,
        dimension: usize,
        picks: &[Pick],
        index: &mut Vec<usize>,
        offset: usize,
        value: &impl Fn(&[usize]) -> f64,
    ) {
        if dimension == self.shape.len() {
            self.values[offset] = value(index);
            return;
        }
        let size = self.shape[dimension];
        let range = match picks.get(dimension).copied().flatten() {
            Some(fixed) => fixed..fixed + 1,
            None => 0..size,
        };
        for i in range {
            index[dimension] = i;
            self.write_from(dimension + 1, picks, index, offset * size + i, value);
        }
    }
}
