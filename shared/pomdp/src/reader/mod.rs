//! Reader of Cassandra's `.pomdp` format.
//!
//! Rules are kept as they are written, then played back row by row, so that later ones win and
//! nothing of the size |S|^2 is ever allocated. Limits on text, names, rows, entries and work bound
//! memory and time for any text.

mod cursor;
mod lexer;
pub(crate) mod limits;
mod preamble;
mod probability_rows;
mod replay;
mod reward_blocks;
mod rules;
mod start;

use cursor::Cursor;
pub(crate) use cursor::is_reserved;

use crate::model::{Parts, Pomdp};
use crate::parse_error::ParseError;

impl Pomdp {
    /// Reads Cassandra's `.pomdp` format.
    ///
    /// Memory: at most about ten times the text, besides tables of 2^24 entries.
    ///
    /// # Errors
    /// [`ParseError`] with line and column, what was found and what is allowed.
    pub fn parse(text: &str) -> Result<Self, ParseError> {
        read(text)
    }
}

fn read(text: &str) -> Result<Pomdp, ParseError> {
    let mut cursor = Cursor::new(text)?;
    let preamble = preamble::read(&mut cursor)?;
    let start_at = cursor.at();
    let start = start::read(&mut cursor, &preamble.states)?;
    let rules = rules::read(&mut cursor, &preamble, &start)?;
    let sizes = preamble.sizes();
    let name = |action, state| {
        let (action, state) = (preamble.actions.name(action), preamble.states.name(state));
        format!("T: {action} : {state}")
    };
    let (transitions, transition_at) =
        probability_rows::transitions(&rules.transition, &start, name)?;
    let (observation, observation_at) = if preamble.is_mdp {
        (vec![1.0; sizes.actions * sizes.states], Vec::new())
    } else {
        probability_rows::observations(&rules.observation, sizes.observations)?
    };
    let sign = if preamble.is_cost { -1.0 } else { 1.0 };
    let rewards = reward_blocks::rewards(&rules.reward, sizes.observations, sign)?;
    Pomdp::from_parts(Parts {
        discount: preamble.discount,
        is_cost: preamble.is_cost,
        states: preamble.states.into_names(),
        actions: preamble.actions.into_names(),
        observations: preamble.observations.into_names(),
        start,
        start_at,
        transitions,
        observation,
        rewards,
        row_at: [transition_at, observation_at],
        warnings: Vec::new(),
    })
}
