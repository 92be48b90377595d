//! A model from nested sequences.

use pyo3::prelude::*;
use vigil_pomdp::{Pomdp, Process};

use crate::errors::refusal;

type Rows = Vec<Vec<f64>>;

/// The tables of a model; the action comes first in each.
pub struct Tables {
    pub discount: f64,
    /// T[a][s][s'].
    pub transitions: Vec<Rows>,
    /// Z[a][s'][z]; none for an MDP.
    pub observations: Option<Vec<Rows>>,
    /// R[a][s].
    pub rewards: Rows,
    /// b(s); uniform without any.
    pub start: Option<Vec<f64>>,
    pub state_names: Option<Vec<String>>,
    pub action_names: Option<Vec<String>>,
    pub observation_names: Option<Vec<String>>,
}

impl Tables {
    /// The model.
    pub fn model(&self) -> PyResult<Pomdp> {
        self.check()?;
        Pomdp::from_process(self).map_err(refusal)
    }

    fn counts(&self) -> Counts {
        let first = |tables: &Vec<Rows>| tables.first().and_then(|rows| rows.first().map(Vec::len));
        Counts {
            states: self.transitions.first().map_or(0, Vec::len),
            actions: self.transitions.len(),
            observations: self.observations.as_ref().and_then(first).unwrap_or(0),
        }
    }

    /// All tables have the shape that the transitions ask for.
    fn check(&self) -> PyResult<()> {
        let Counts {
            states,
            actions,
            observations,
        } = self.counts();
        if states == 0 || actions == 0 {
            let message = "transitions: empty, allowed are one or more actions and states";
            return Err(refusal(message));
        }
        for (a, rows) in self.transitions.iter().enumerate() {
            shape(&format!("transitions[{a}]"), rows, states, states)?;
        }
        if let Some(tables) = &self.observations {
            length("observations", tables.len(), actions)?;
            for (a, rows) in tables.iter().enumerate() {
                shape(&format!("observations[{a}]"), rows, states, observations)?;
            }
        }
        shape("rewards", &self.rewards, actions, states)?;
        let lists = [
            ("start", self.start.as_ref().map(Vec::len), states),
            (
                "state_names",
                self.state_names.as_ref().map(Vec::len),
                states,
            ),
            (
                "action_names",
                self.action_names.as_ref().map(Vec::len),
                actions,
            ),
            (
                "observation_names",
                self.observation_names.as_ref().map(Vec::len),
                observations,
            ),
        ];
        for (name, found, wanted) in lists {
            length(name, found.unwrap_or(wanted), wanted)?;
        }
        Ok(())
    }
}

struct Counts {
    states: usize,
    actions: usize,
    observations: usize,
}

fn shape(name: &str, rows: &Rows, height: usize, width: usize) -> PyResult<()> {
    length(name, rows.len(), height)?;
    let mut rows = rows.iter().enumerate();
    rows.try_for_each(|(at, row)| length(&format!("{name}[{at}]"), row.len(), width))
}

fn length(name: &str, found: usize, wanted: usize) -> PyResult<()> {
    if found == wanted {
        return Ok(());
    }
    Err(refusal(format!(
        "{name} has {found} entries, allowed are {wanted}"
    )))
}

fn names(given: Option<&Vec<String>>, letter: char, count: usize) -> Vec<String> {
    let numbered = || (0..count).map(|at| format!("{letter}{at}")).collect();
    given.cloned().unwrap_or_else(numbered)
}

fn entries(row: &[f64]) -> Vec<(usize, f64)> {
    let entries = row.iter().copied().enumerate();
    entries.filter(|(_, p)| *p != 0.0).collect()
}

impl Process for Tables {
    fn discount(&self) -> f64 {
        self.discount
    }

    fn states(&self) -> Vec<String> {
        names(self.state_names.as_ref(), 's', self.counts().states)
    }

    fn actions(&self) -> Vec<String> {
        names(self.action_names.as_ref(), 'a', self.counts().actions)
    }

    fn observations(&self) -> Vec<String> {
        names(
            self.observation_names.as_ref(),
            'z',
            self.counts().observations,
        )
    }

    fn start(&self) -> Vec<(usize, f64)> {
        let states = self.counts().states;
        let uniform = || vec![1.0 / states as f64; states];
        entries(&self.start.clone().unwrap_or_else(uniform))
    }

    fn transition(&self, state: usize, action: usize) -> Vec<(usize, f64)> {
        entries(&self.transitions[action][state])
    }

    fn observation(&self, action: usize, next: usize) -> Vec<(usize, f64)> {
        let tables = self.observations.as_ref();
        tables.map_or_else(Vec::new, |tables| entries(&tables[action][next]))
    }

    fn reward(&self, state: usize, action: usize) -> f64 {
        self.rewards[action][state]
    }
}
