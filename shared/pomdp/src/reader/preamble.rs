//! Discount, kind of values, names; in any order.

use super::cursor::{Cursor, Names};
use super::lexer::Token;
use crate::parse_error::ParseError;

/// What stands before the start belief.
pub(super) struct Preamble {
    pub discount: f64,
    /// `values: cost`.
    pub is_cost: bool,
    pub states: Names,
    pub actions: Names,
    /// `none` alone if the model has none.
    pub observations: Names,
    /// No observations: a fully observable model.
    pub is_mdp: bool,
}

/// Numbers of states, actions and observations.
#[derive(Debug, Clone, Copy)]
pub(super) struct Sizes {
    pub states: usize,
    pub actions: usize,
    pub observations: usize,
}

impl Preamble {
    pub(super) fn sizes(&self) -> Sizes {
        Sizes {
            states: self.states.len(),
            actions: self.actions.len(),
            observations: self.observations.len(),
        }
    }
}

/// Reads up to the first word that belongs to no preamble. Later lines win.
pub(super) fn read(cursor: &mut Cursor<'_>) -> Result<Preamble, ParseError> {
    let (mut discount, mut is_cost) = (None, false);
    let (mut states, mut actions, mut observations) = (None, None, None);
    loop {
        if cursor.accept("discount")? {
            discount = Some(read_discount(cursor)?);
        } else if cursor.accept("values")? {
            is_cost = read_values(cursor)?;
        } else if cursor.accept("states")? {
            states = Some(cursor.names()?);
        } else if cursor.accept("actions")? {
            actions = Some(cursor.names()?);
        } else if cursor.accept("observations")? {
            observations = Some(cursor.names()?);
        } else {
            break;
        }
    }
    let at = cursor.at();
    let missing = |what: &str| ParseError::new(at, format!("{what} is missing before here"));
    let is_mdp = observations.is_none();
    Ok(Preamble {
        discount: discount.ok_or_else(|| missing("discount:"))?,
        is_cost,
        states: states.ok_or_else(|| missing("states:"))?,
        actions: actions.ok_or_else(|| missing("actions:"))?,
        observations: observations.unwrap_or_else(|| {
            let mut none = Names::default();
            none.add("none");
            none
        }),
        is_mdp,
    })
}

fn read_discount(cursor: &mut Cursor<'_>) -> Result<f64, ParseError> {
    cursor.colon()?;
    let at = cursor.at();
    let value = cursor.number()?;
    if (0.0..=1.0).contains(&value) {
        return Ok(value);
    }
    let message = format!("discount is {value}, allowed is 0 to 1");
    Err(ParseError::new(at, message))
}

fn read_values(cursor: &mut Cursor<'_>) -> Result<bool, ParseError> {
    cursor.colon()?;
    let is_cost = match cursor.peek() {
        Token::Word("reward") => false,
        Token::Word("cost") => true,
        _ => return cursor.wrong("reward or cost"),
    };
    cursor.take()?;
    Ok(is_cost)
}
