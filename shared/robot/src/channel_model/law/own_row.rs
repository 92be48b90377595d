//! Rows of one channel under its law given all other readings.

use super::Row;
use crate::channel_model::square::{by_block, sums_from};

/// A row of a channel.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct OwnRow {
    pub(super) row: Row,
    /// What each block has in common with itself, by half, and with later ones.
    pub(super) later: Row,
}

impl OwnRow {
    /// Its square from each block on.
    #[must_use]
    pub fn square(&self) -> Row {
        sums_from(by_block(&self.row, &self.later)).map(|half| 2.0 * half)
    }

    /// Its product with another one from each block on.
    #[must_use]
    pub fn product(&self, other: &Self) -> Row {
        sums_from(std::array::from_fn(|block| {
            self.row[block] * other.later[block] + other.row[block] * self.later[block]
        }))
    }
}
