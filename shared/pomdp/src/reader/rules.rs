//! The rules T, O and R, in any order and every form.

use super::cursor::{Cursor, Names, Pick};
use super::lexer::Token;
use super::limits::{self, ENTRIES_MAX, WRITES_PER_REWARD};
use super::preamble::{Preamble, Sizes};
use super::probability_rows::Fill;
use super::replay::{Rule, Rules};
use super::reward_blocks::RewardFill;
use crate::model::sparse::Sparse;
use crate::parse_error::{ParseError, Position};

/// The rules of one text.
pub(super) struct Tables {
    pub transition: Rules<Fill>,
    pub observation: Rules<Fill>,
    pub reward: Rules<RewardFill>,
}

/// Reads rules to the end of the text.
pub(super) fn read(
    cursor: &mut Cursor<'_>,
    preamble: &Preamble,
    start: &[f64],
) -> Result<Tables, ParseError> {
    let sizes = preamble.sizes();
    let (n, a) = (sizes.states, sizes.actions);
    let at = cursor.at();
    let mut tables = Tables {
        transition: Rules::new(a, n, at, "T")?,
        observation: Rules::new(a, n, at, "O")?,
        reward: Rules::new(a, n, at, "R")?,
    };
    limits::check(
        (a * n).checked_mul(sizes.observations),
        ENTRIES_MAX,
        at,
        "O entries",
    )?;
    let start_entries = start.iter().filter(|p| **p > 0.0).count();
    let mut reader = Reader {
        cursor,
        preamble,
        sizes,
    };
    loop {
        match reader.cursor.peek() {
            Token::End => return Ok(tables),
            Token::Word("T") => reader.transition(&mut tables.transition, start_entries)?,
            Token::Word("O") => reader.observation(&mut tables.observation)?,
            Token::Word("R") => reader.reward(&mut tables.reward)?,
            _ => return reader.cursor.wrong("T, O, R or the end"),
        }
    }
}

struct Reader<'c, 'a, 'p> {
    cursor: &'c mut Cursor<'a>,
    preamble: &'p Preamble,
    sizes: Sizes,
}

impl Reader<'_, '_, '_> {
    /// `a [: x [: y ...]]` after `T`, `O` or `R`; those that are left out are `None`.
    fn picks<const N: usize>(
        &mut self,
        dimensions: [(&Names, &str); N],
    ) -> Result<([Pick; N], usize), ParseError> {
        self.cursor.take()?;
        let mut picks = [None; N];
        let mut count = 0;
        for (pick, (names, what)) in picks.iter_mut().zip(dimensions) {
            if self.cursor.peek() != Token::Colon {
                break;
            }
            self.cursor.take()?;
            *pick = self.cursor.pick(names, what)?;
            count += 1;
        }
        if count == 0 {
            return self.cursor.wrong("':' and an action");
        }
        Ok((picks, count))
    }

    fn transition(
        &mut self,
        rules: &mut Rules<Fill>,
        start_entries: usize,
    ) -> Result<(), ParseError> {
        let (at, n) = (self.cursor.at(), self.sizes.states);
        let states = (&self.preamble.states, "state");
        let actions = (&self.preamble.actions, "action");
        let (picks, count) = self.picks([actions, states, states])?;
        let cursor = &mut *self.cursor;
        let fill = match count {
            3 => Fill::One(picks[2], cursor.probability()?),
            _ if cursor.accept("uniform")? => Fill::Uniform,
            2 if cursor.accept("reset")? => Fill::Reset,
            2 => Fill::Row(sparse_row(cursor, n)?),
            _ if cursor.accept("identity")? => Fill::Identity,
            _ => Fill::Matrix(matrix(cursor, n, n)?),
        };
        let entries = match &fill {
            Fill::Reset => start_entries,
            fill => fill.entries(n),
        };
        rules.push(rule(&picks, fill, at), entries)
    }

    fn observation(&mut self, rules: &mut Rules<Fill>) -> Result<(), ParseError> {
        if self.preamble.is_mdp {
            return self.cursor.wrong("no O: the model has no observations");
        }
        let (at, n, k) = (self.cursor.at(), self.sizes.states, self.sizes.observations);
        let (picks, count) = self.picks([
            (&self.preamble.actions, "action"),
            (&self.preamble.states, "state"),
            (&self.preamble.observations, "observation"),
        ])?;
        let cursor = &mut *self.cursor;
        let fill = match count {
            3 => Fill::One(picks[2], cursor.probability()?),
            _ if cursor.accept("uniform")? => Fill::Uniform,
            2 => Fill::Row(sparse_row(cursor, k)?),
            _ => Fill::Matrix(matrix(cursor, n, k)?),
        };
        let entries = fill.entries(k);
        rules.push(rule(&picks, fill, at), entries)
    }

    fn reward(&mut self, rules: &mut Rules<RewardFill>) -> Result<(), ParseError> {
        let (at, n, k) = (self.cursor.at(), self.sizes.states, self.sizes.observations);
        let states = (&self.preamble.states, "state");
        let (picks, count) = self.picks([
            (&self.preamble.actions, "action"),
            states,
            states,
            (&self.preamble.observations, "observation"),
        ])?;
        let cursor = &mut *self.cursor;
        let fill = match count {
            // The only observation is all of them.
            3 | 4 if k == 1 => RewardFill::One(picks[2], None, cursor.number()?),
            4 => RewardFill::One(picks[2], picks[3], cursor.number()?),
            3 => RewardFill::Row(picks[2], numbers(cursor, k)?),
            2 => RewardFill::Matrix(numbers(cursor, n * k)?),
            _ if self.preamble.is_mdp => RewardFill::BySuccessor(numbers(cursor, n * n)?),
            _ => return cursor.wrong("':' and a state: 'R: a' alone is for models without O"),
        };
        let entries = fill.entries(n, k) * WRITES_PER_REWARD;
        rules.push(rule(&picks, fill, at), entries)
    }
}

fn rule<F>(picks: &[Pick], fill: F, at: Position) -> Rule<F> {
    Rule {
        action: picks.first().copied().flatten(),
        state: picks.get(1).copied().flatten(),
        fill,
        at,
    }
}

fn sparse_row(cursor: &mut Cursor<'_>, width: usize) -> Result<Vec<(usize, f64)>, ParseError> {
    let mut row = Vec::new();
    for column in 0..width {
        let p = cursor.probability()?;
        if p > 0.0 {
            row.push((column, p));
        }
    }
    Ok(row)
}

fn matrix(cursor: &mut Cursor<'_>, rows: usize, width: usize) -> Result<Sparse, ParseError> {
    let mut sparse = Sparse::default();
    for _ in 0..rows {
        sparse.push(sparse_row(cursor, width)?);
    }
    Ok(sparse)
}

fn numbers(cursor: &mut Cursor<'_>, count: usize) -> Result<Vec<f64>, ParseError> {
    (0..count).map(|_| cursor.number()).collect()
}
