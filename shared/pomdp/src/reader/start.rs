//! The start belief: a state, a list of probabilities, or equal weights over some states.

use super::cursor::{Cursor, Names};
use super::lexer::Token;
use crate::parse_error::ParseError;

/// Reads it; uniform if none is given. Its sum is checked with the rows of T.
pub(super) fn read(cursor: &mut Cursor<'_>, states: &Names) -> Result<Vec<f64>, ParseError> {
    let n = states.len();
    let everywhere = || equal(n, |_| true);
    if !cursor.accept("start")? {
        return Ok(everywhere());
    }
    let at = cursor.at();
    let include = cursor.accept("include")?;
    let exclude = !include && cursor.accept("exclude")?;
    cursor.colon()?;
    if include || exclude {
        let mut listed = vec![false; n];
        while !cursor.is_at_rule() {
            listed[cursor.one(states, "state")?] = true;
        }
        if !listed.contains(&include) {
            let message = "no state is left to start in, allowed is at least one";
            return Err(ParseError::new(at, message));
        }
        return Ok(equal(n, |s| listed[s] == include));
    }
    if cursor.accept("uniform")? {
        return Ok(everywhere());
    }
    let is_one = matches!(cursor.peek(), Token::Word(_)) || (n > 1 && cursor.is_one_number()?);
    if is_one {
        let state = cursor.one(states, "state")?;
        return Ok(equal(n, |s| s == state));
    }
    (0..n).map(|_| cursor.probability()).collect()
}

/// Equal weights over the states that are `among`.
fn equal(n: usize, among: impl Fn(usize) -> bool) -> Vec<f64> {
    let count = (0..n).filter(|&s| among(s)).count() as f64;
    (0..n)
        .map(|s| if among(s) { 1.0 / count } else { 0.0 })
        .collect()
}
