//! Rules over rows (action, state), and for each row those that touch it, in their order.

use super::cursor::Pick;
use super::limits::{self, ROWS_MAX, WRITES_MAX};
use crate::parse_error::{ParseError, Position};

/// What one rule does to each of the rows that it covers.
#[derive(Debug)]
pub(super) struct Rule<F> {
    pub action: Pick,
    pub state: Pick,
    pub fill: F,
    pub at: Position,
}

/// All rules of a table, in the order of the text.
#[derive(Debug)]
pub(super) struct Rules<F> {
    pub actions: usize,
    pub states: usize,
    /// Where the rules begin.
    pub at: Position,
    /// Entries that the rules write.
    writes: usize,
    rules: Vec<Rule<F>>,
}

impl<F> Rules<F> {
    pub(super) fn new(
        actions: usize,
        states: usize,
        at: Position,
        table: &str,
    ) -> Result<Self, ParseError> {
        let rows = actions.checked_mul(states);
        let what = format!("{table} for {actions} actions x {states} states has too many entries");
        limits::check(rows, ROWS_MAX, at, &what)?;
        Ok(Self {
            actions,
            states,
            at,
            writes: 0,
            rules: Vec::new(),
        })
    }

    /// Adds a rule that writes `entries` entries in each of its rows.
    pub(super) fn push(&mut self, rule: Rule<F>, entries: usize) -> Result<(), ParseError> {
        let rows = rule.action.map_or(self.actions, |_| 1) * rule.state.map_or(self.states, |_| 1);
        let writes = rows
            .checked_mul(entries.max(1))
            .and_then(|writes| writes.checked_add(self.writes));
        limits::check(writes, WRITES_MAX, rule.at, "entries that rules write")?;
        self.writes = writes.unwrap_or(self.writes);
        self.rules.push(rule);
        Ok(())
    }

    /// Calls `row(action, state, rules)` for every row, states running faster. The rules are given
    /// by their numbers, see [`Self::rule`].
    pub(super) fn play(
        &self,
        mut row: impl FnMut(usize, usize, &[u32]) -> Result<(), ParseError>,
    ) -> Result<(), ParseError> {
        let whole = self.list(1, |rule| {
            (rule.action.is_none() && rule.state.is_none()).then_some(0)
        });
        let by_state = self.list(self.states, |rule| {
            rule.state.filter(|_| rule.action.is_none())
        });
        let by_action = self.list(self.actions, |rule| {
            rule.action.filter(|_| rule.state.is_none())
        });
        let by_row = self.list(self.actions * self.states, |rule| {
            Some(rule.action? * self.states + rule.state?)
        });
        let mut numbers = Vec::new();
        for action in 0..self.actions {
            for state in 0..self.states {
                numbers.clear();
                let parts = [
                    whole.indices(0),
                    by_state.indices(state),
                    by_action.indices(action),
                    by_row.indices(action * self.states + state),
                ];
                for part in parts {
                    numbers.extend_from_slice(part);
                }
                if parts.iter().filter(|part| !part.is_empty()).count() > 1 {
                    numbers.sort_unstable();
                }
                row(action, state, &numbers)?;
            }
        }
        Ok(())
    }

    /// The rule of that number.
    pub(super) fn rule(&self, number: u32) -> &Rule<F> {
        &self.rules[number as usize]
    }

    fn list(&self, keys: usize, key: impl Fn(&Rule<F>) -> Option<usize>) -> Lists {
        let mut starts = vec![0_u32; keys + 1];
        for key in self.rules.iter().filter_map(&key) {
            starts[key + 1] += 1;
        }
        for i in 0..keys {
            starts[i + 1] += starts[i];
        }
        let mut next = starts.clone();
        let mut numbers = vec![0; starts[keys] as usize];
        for (number, rule) in self.rules.iter().enumerate() {
            if let Some(key) = key(rule) {
                numbers[next[key] as usize] = number as u32;
                next[key] += 1;
            }
        }
        Lists { starts, numbers }
    }
}

/// Numbers of rules by a key.
struct Lists {
    starts: Vec<u32>,
    numbers: Vec<u32>,
}

impl Lists {
    fn indices(&self, key: usize) -> &[u32] {
        &self.numbers[self.starts[key] as usize..self.starts[key + 1] as usize]
    }
}
