//! What a text may ask for. Together these bound memory to about 1 GB for the model and ten times
//! the text for its reading, and time to seconds.

use crate::parse_error::{ParseError, Position};

/// Longest text, bytes.
pub(crate) const TEXT_BYTES_MAX: usize = 256 << 20;
/// Most states, actions or observations.
pub(crate) const NAMES_MAX: usize = 100_000;
/// Most pairs of a state and an action.
pub(crate) const ROWS_MAX: usize = 1 << 22;
/// Most entries that are stored of T (other than 0), of Z, and of R (where it depends on the
/// outcome).
pub(crate) const ENTRIES_MAX: usize = 1 << 24;
/// Most entries that all rules of one table write, those that are overwritten included.
pub(crate) const WRITES_MAX: usize = 1 << 26;

/// To write a reward takes about so many times as long as to write a probability.
pub(crate) const WRITES_PER_REWARD: usize = 8;

/// Refuses `count` beyond `most`.
pub(crate) fn check(
    count: Option<usize>,
    most: usize,
    at: Position,
    what: &str,
) -> Result<(), ParseError> {
    if count.is_some_and(|count| count <= most) {
        return Ok(());
    }
    let found = count.map_or_else(|| "too many".to_owned(), |count| count.to_string());
    let message = format!("{what}: {found}, allowed are {most}");
    Err(ParseError::new(at, message))
}
