//! R(s,a,s',z) from its rules.

use std::collections::{BTreeMap, HashMap};

use super::cursor::Pick;
use super::limits::{self, ENTRIES_MAX};
use super::replay::Rules;
use crate::model::rewards::{Block, BlockSize, Rewards};
use crate::parse_error::ParseError;

/// What a rule writes into R(s,a,.,.).
#[derive(Debug)]
pub(super) enum RewardFill {
    /// One value for some s' and z.
    One(Pick, Pick, f64),
    /// For some s', a value for each z.
    Row(Pick, Vec<f64>),
    /// A value for each (s', z).
    Matrix(Vec<f64>),
    /// Without observations, a value for each (s, s').
    BySuccessor(Vec<f64>),
}

impl RewardFill {
    /// So many entries are written into a block.
    pub(super) fn entries(&self, next: usize, observations: usize) -> usize {
        let all = |pick: &Pick, size: usize| pick.map_or(size, |_| 1);
        match self {
            Self::One(None, None, _) => 1,
            Self::One(to, z, _) => all(to, next) * all(z, observations),
            Self::Row(to, _) => all(to, next) * observations,
            Self::Matrix(_) | Self::BySuccessor(_) => next * observations,
        }
    }

    /// True if nothing of what was there is left.
    const fn is_whole(&self) -> bool {
        matches!(
            self,
            Self::One(None, None, _) | Self::Row(None, _) | Self::Matrix(_) | Self::BySuccessor(_)
        )
    }
}

/// A block while it is written.
#[derive(Default)]
struct Draft {
    rest: f64,
    others: BTreeMap<(u32, u32), f64>,
}

impl Draft {
    fn apply(&mut self, fill: &RewardFill, state: usize, next: usize, observations: usize) {
        if fill.is_whole() {
            self.others.clear();
        }
        let range = |pick: &Pick, size: usize| pick.map_or(0..size, |one| one..one + 1);
        match fill {
            RewardFill::One(None, None, value) => self.rest = *value,
            RewardFill::One(to, z, value) => {
                for to in range(to, next) {
                    for z in range(z, observations) {
                        self.others.insert((to as u32, z as u32), *value);
                    }
                }
            }
            RewardFill::Row(to, row) => {
                for to in range(to, next) {
                    self.write_row(to, row);
                }
            }
            RewardFill::Matrix(matrix) => {
                for (to, row) in matrix.chunks(observations).enumerate() {
                    self.write_row(to, row);
                }
            }
            RewardFill::BySuccessor(matrix) => {
                for (to, value) in matrix[state * next..][..next].iter().enumerate() {
                    self.write_row(to, std::slice::from_ref(value));
                }
            }
        }
    }

    fn write_row(&mut self, to: usize, row: &[f64]) {
        for (z, value) in row.iter().enumerate() {
            self.others.insert((to as u32, z as u32), *value);
        }
    }

    fn block(self, size: BlockSize, sign: f64) -> Block {
        let others = self.others.into_iter();
        // Never a negative zero.
        let others = others.map(|((to, z), value)| (to, z, sign * value + 0.0));
        Block::new(size, sign * self.rest + 0.0, others.collect())
    }
}

/// All of R, times `sign`.
pub(super) fn rewards(
    rules: &Rules<RewardFill>,
    observations: usize,
    sign: f64,
) -> Result<Rewards, ParseError> {
    let next = rules.states;
    let mut of = Vec::with_capacity(rules.actions * rules.states);
    let mut blocks: Vec<Block> = Vec::new();
    // Most rows have the same rules.
    let mut known: HashMap<Vec<u32>, u32> = HashMap::new();
    let mut kept = 0;
    rules.play(|_, state, numbers| {
        let fill = |number: &u32| &rules.rule(*number).fill;
        let whole = numbers.iter().rposition(|number| fill(number).is_whole());
        let numbers = &numbers[whole.unwrap_or(0)..];
        let by_state = |number: &u32| matches!(fill(number), RewardFill::BySuccessor(_));
        let is_shared = !numbers.iter().any(by_state);
        if let (true, Some(&block)) = (is_shared, known.get(numbers)) {
            of.push(block);
            return Ok(());
        }
        let mut draft = Draft::default();
        for number in numbers {
            draft.apply(fill(number), state, next, observations);
        }
        let block = draft.block(BlockSize { next, observations }, sign);
        kept += block.others.len();
        let at = numbers.last().map_or(rules.at, |&n| rules.rule(n).at);
        limits::check(Some(kept), ENTRIES_MAX, at, "R entries")?;
        let id = blocks.len() as u32;
        blocks.push(block);
        of.push(id);
        if is_shared {
            known.insert(numbers.to_vec(), id);
        }
        Ok(())
    })?;
    Ok(Rewards::new(next, &of, blocks))
}
