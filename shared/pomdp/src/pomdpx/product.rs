//! Multiplies factored tables out.

use std::collections::HashMap;

use super::factors::{Factor, Factors};
use super::scope::Scope;
use super::table::Budget;
use crate::model::rewards::{Block, BlockSize, Rewards};
use crate::model::sparse::Sparse;
use crate::parse_error::{ParseError, Position};
use crate::reader::limits::{ENTRIES_MAX, WRITES_PER_REWARD};

/// Where the work or the entries run out.
const NOWHERE: Position = Position { line: 1, column: 1 };

/// The flat tables of a model.
pub(super) struct Product<'a> {
    scope: &'a Scope,
    factors: &'a mut Factors,
    /// A value of every variable.
    at: Vec<usize>,
}

impl<'a> Product<'a> {
    pub(super) fn new(scope: &'a Scope, factors: &'a mut Factors) -> Self {
        let at = vec![0; scope.slots.len()];
        Self { scope, factors, at }
    }

    pub(super) fn start(&mut self) -> Result<Vec<f64>, ParseError> {
        let scope = self.scope;
        let mut start = vec![0.0; scope.states()];
        let Factors {
            start: of, budget, ..
        } = &mut *self.factors;
        expand(of, scope, &mut self.at, 1.0, budget, &mut |at, p| {
            start[scope.index(scope.before(), at)] = p;
        })?;
        Ok(start)
    }

    pub(super) fn transitions(&mut self) -> Result<Vec<Sparse>, ParseError> {
        let scope = self.scope;
        let (acts, before) = (slots(scope.action_slots()), slots(scope.before()));
        let mut entries = 0;
        let mut all = Vec::with_capacity(scope.actions());
        for action in 0..scope.actions() {
            let mut sparse = Sparse::default();
            scope.assign(&acts, action, &mut self.at);
            for state in 0..scope.states() {
                scope.assign(&before, state, &mut self.at);
                let mut row = Vec::new();
                let Factors {
                    transition, budget, ..
                } = &mut *self.factors;
                expand(
                    transition,
                    scope,
                    &mut self.at,
                    1.0,
                    budget,
                    &mut |at, p| {
                        row.push((scope.index(scope.after(), at), p));
                    },
                )?;
                row.sort_unstable_by_key(|(to, _)| *to);
                entries += row.len();
                sparse.push(row);
                check_entries("T", entries)?;
            }
            all.push(sparse);
        }
        Ok(all)
    }

    /// Z[a][z][s'].
    pub(super) fn observation(&mut self) -> Result<Vec<f64>, ParseError> {
        let scope = self.scope;
        let (n, k) = (scope.states(), scope.observations());
        let (acts, after) = (slots(scope.action_slots()), slots(scope.after()));
        let seen = scope.observation_slots();
        let mut all = vec![0.0; scope.actions() * k * n];
        for action in 0..scope.actions() {
            scope.assign(&acts, action, &mut self.at);
            for state in 0..n {
                scope.assign(&after, state, &mut self.at);
                let Factors {
                    observation,
                    budget,
                    ..
                } = &mut *self.factors;
                expand(
                    observation,
                    scope,
                    &mut self.at,
                    1.0,
                    budget,
                    &mut |at, p| {
                        let z = scope.index(seen.iter().copied(), at);
                        all[(action * k + z) * n + state] = p;
                    },
                )?;
            }
        }
        Ok(all)
    }

    pub(super) fn rewards(&mut self) -> Result<Rewards, ParseError> {
        let scope = self.scope;
        let n = scope.states();
        let (acts, before) = (slots(scope.action_slots()), slots(scope.before()));
        let used: Vec<usize> = (0..scope.before().end)
            .filter(|slot| self.factors.reward.iter().any(|t| t.slots.contains(slot)))
            .collect();
        let by_outcome = |slot: &usize| *slot >= scope.before().end;
        let depends = self.factors.reward.iter();
        let depends = depends.flat_map(|t| &t.slots).any(by_outcome);
        let (mut of, mut blocks, mut entries) = (Vec::new(), Vec::new(), 0);
        let mut known: HashMap<Vec<usize>, u32> = HashMap::new();
        for action in 0..scope.actions() {
            scope.assign(&acts, action, &mut self.at);
            for state in 0..n {
                scope.assign(&before, state, &mut self.at);
                let key: Vec<usize> = used.iter().map(|&slot| self.at[slot]).collect();
                if let Some(&block) = known.get(&key) {
                    of.push(block);
                    continue;
                }
                let block = if depends {
                    self.outcomes()?
                } else {
                    self.spend(1)?;
                    Block::new(self.block_size(), self.reward_here(), Vec::new())
                };
                entries += block.others.len();
                check_entries("R", entries)?;
                let id = blocks.len() as u32;
                blocks.push(block);
                of.push(id);
                known.insert(key, id);
            }
        }
        Ok(Rewards::new(n, &of, blocks))
    }

    fn block_size(&self) -> BlockSize {
        BlockSize {
            next: self.scope.states(),
            observations: self.scope.observations(),
        }
    }

    /// R(s,a,.,.) of the state and action that are set.
    fn outcomes(&mut self) -> Result<Block, ParseError> {
        let scope = self.scope;
        let (n, k) = (scope.states(), scope.observations());
        self.spend(n.saturating_mul(k).saturating_mul(WRITES_PER_REWARD))?;
        let after = slots(scope.after());
        let all = scope.observation_slots();
        let mut others = Vec::with_capacity(n * k);
        for to in 0..n {
            for z in 0..k {
                // Observed state variables are what the state says.
                scope.assign(&all, z, &mut self.at);
                scope.assign(&after, to, &mut self.at);
                others.push((to as u32, z as u32, self.reward_here()));
            }
        }
        Ok(Block::new(self.block_size(), 0.0, others))
    }

    /// Takes work for so many evaluations of the reward.
    fn spend(&mut self, evaluations: usize) -> Result<(), ParseError> {
        let tables = self.factors.reward.len().max(1);
        let spent = self.factors.budget.work(evaluations.saturating_mul(tables));
        spent.map_err(|message| ParseError::new(NOWHERE, message))
    }

    fn reward_here(&self) -> f64 {
        let tables = self.factors.reward.iter();
        tables.map(|table| table.at(&self.at)).sum::<f64>() + 0.0
    }
}

fn slots(range: std::ops::Range<usize>) -> Vec<usize> {
    range.collect()
}

fn check_entries(table: &str, entries: usize) -> Result<(), ParseError> {
    let what = format!("{table} entries");
    crate::reader::limits::check(Some(entries), ENTRIES_MAX, NOWHERE, &what)
}

/// Calls `visit` with every combination of the factors' values that has a probability, and with
/// that. As deep as there are factors.
fn expand(
    factors: &[Factor],
    scope: &Scope,
    at: &mut [usize],
    p: f64,
    budget: &mut Budget,
    visit: &mut impl FnMut(&[usize], f64),
) -> Result<(), ParseError> {
    let Some((first, rest)) = factors.split_first() else {
        visit(at, p);
        return Ok(());
    };
    let values = scope.slots[first.slot].values.len();
    let spent = budget.work(values.saturating_mul(first.table.slots.len()));
    spent.map_err(|message| ParseError::new(NOWHERE, message))?;
    for value in 0..values {
        at[first.slot] = value;
        let here = p * first.table.at(at);
        if here > 0.0 {
            expand(rest, scope, at, here, budget, visit)?;
        }
    }
    Ok(())
}
