//! p(s',z|s,a) = T(s,a,s') Z(a,s',z), laid out for one observation after the other: a belief
//! update visits only what the observation leaves possible.

use super::sparse::Sparse;

/// Most entries that are kept, 24 MB; beyond it, updates multiply T and Z themselves.
const ENTRIES_MAX: usize = 1 << 21;

/// Compressed sparse rows per (a, z), columns and values apart.
#[derive(Debug, Clone)]
pub(crate) struct Joint {
    states: usize,
    observations: usize,
    /// Of row s of (a, z) at (a * observations + z) * states + s.
    starts: Vec<u32>,
    columns: Vec<u32>,
    values: Vec<f64>,
}

impl Joint {
    /// From T per action and Z[a][z][s']; `None` if it would be too large to be of use.
    pub(super) fn new(transitions: &[Sparse], observation: &[f64], states: usize) -> Option<Self> {
        let observations = observation.len() / (transitions.len() * states).max(1);
        let rows = transitions.len() * observations * states;
        if rows > ENTRIES_MAX {
            return None;
        }
        let mut joint = Self {
            states,
            observations,
            starts: Vec::with_capacity(rows + 1),
            columns: Vec::new(),
            values: Vec::new(),
        };
        joint.starts.push(0);
        for (block, likelihood) in observation.chunks(states).enumerate() {
            let transition = &transitions[block / observations];
            for s in 0..states {
                for &(to, p) in transition.row(s) {
                    let value = p * likelihood[to];
                    if value > 0.0 {
                        joint.columns.push(to as u32);
                        joint.values.push(value);
                    }
                }
                joint.starts.push(joint.columns.len() as u32);
            }
            if joint.columns.len() > ENTRIES_MAX {
                return None;
            }
        }
        Some(joint)
    }

    /// Of one action and observation: see [`Rows::row`].
    pub(crate) fn rows(&self, action: usize, observation: usize) -> Rows<'_> {
        let first = (action * self.observations + observation) * self.states;
        Rows {
            joint: self,
            starts: &self.starts[first..=first + self.states],
        }
    }
}

/// p(.,z|.,a).
#[derive(Clone, Copy)]
pub(crate) struct Rows<'a> {
    joint: &'a Joint,
    starts: &'a [u32],
}

impl<'a> Rows<'a> {
    /// The s' that can follow `state` with this observation, and p(s',z|s,a) of each.
    pub(crate) fn row(self, state: usize) -> (&'a [u32], &'a [f64]) {
        let range = self.starts[state] as usize..self.starts[state + 1] as usize;
        (
            &self.joint.columns[range.clone()],
            &self.joint.values[range],
        )
    }
}
