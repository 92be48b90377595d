//! The entropy to expect after an action: what an action teaches.
//!
//! With b'(s') = sum_s T(s,a,s') b(s), u(s',z) = b'(s') Z(a,s',z) and p(z) = sum_s' u(s',z), the
//! expected entropy of the next belief is
//! sum_z p(z) h(u(.,z)/p(z)) = sum_z [p(z) ln p(z) - sum_s' u(s',z) ln u(s',z)].
//! In the second sum the logarithm of a product splits: it is sum_s' of
//! b'(s') sum_z Z ln Z, known beforehand, and b' ln b' sum_z Z. So there are |S| + |Z| logarithms
//! an action, and not |S| |Z|. The action's entropy needs those of the votes for each observation.

use super::entropy::{minus_p_ln_p, normalised};
use crate::bounds::mdp::Solution;
use crate::model::Pomdp;

/// Looks one step ahead; preallocated.
#[derive(Debug, Clone)]
pub struct LookAhead {
    actions: Vec<Outlook>,
    /// pi_CO of every state.
    best: Vec<usize>,
    /// The belief after the action, before the observation.
    predicted: Vec<f64>,
    votes: Vec<f64>,
}

/// What the model says of one action.
#[derive(Debug, Clone)]
struct Outlook {
    /// Successors of each state: where its part of `entries` ends.
    ends: Vec<usize>,
    entries: Vec<(usize, f64)>,
    /// Z(a,s',z), one row of s' for each observation that can come.
    columns: Vec<f64>,
    /// sum_z Z(a,s',z): 1, but for rounding.
    mass: Vec<f64>,
    /// -sum_z Z ln Z, nats.
    noise: Vec<f64>,
}

impl LookAhead {
    /// For a model and its fully observable relaxation.
    #[must_use]
    pub fn new(model: &Pomdp, solution: &Solution) -> Self {
        let (states, actions) = (model.states().len(), model.actions().len());
        Self {
            actions: (0..actions).map(|a| Outlook::new(model, a)).collect(),
            best: (0..states).map(|s| solution.best(s)).collect(),
            predicted: vec![0.0; states],
            votes: vec![0.0; actions],
        }
    }

    /// Writes, for every action, the expected entropy of the next belief, 0 to 1.
    pub fn state_entropies(&mut self, belief: &[f64], expected: &mut [f64]) {
        let states = self.predicted.len();
        for (outlook, slot) in self.actions.iter().zip(expected) {
            outlook.foresee(belief, &mut self.predicted);
            let within = self.predicted.iter().zip(&outlook.mass).zip(&outlook.noise);
            let mut nats: f64 = within
                .map(|((b, mass), noise)| mass * minus_p_ln_p(*b) + b * noise)
                .sum();
            for column in outlook.columns.chunks_exact(states) {
                let p: f64 = self.predicted.iter().zip(column).map(|(b, z)| b * z).sum();
                nats -= minus_p_ln_p(p);
            }
            *slot = normalised(nats, states);
        }
    }

    /// Writes, for every action, the expected entropy of the next votes
    /// w(k) = sum_s b(s) [pi_CO(s) = k], 0 to 1.
    pub fn action_entropies(&mut self, belief: &[f64], expected: &mut [f64]) {
        let (states, actions) = (self.predicted.len(), self.actions.len());
        for (outlook, slot) in self.actions.iter().zip(expected) {
            outlook.foresee(belief, &mut self.predicted);
            let mut nats = 0.0;
            for column in outlook.columns.chunks_exact(states) {
                self.votes.fill(0.0);
                let mut p = 0.0;
                for ((b, z), best) in self.predicted.iter().zip(column).zip(&self.best) {
                    self.votes[*best] += b * z;
                    p += b * z;
                }
                nats += self.votes.iter().map(|w| minus_p_ln_p(*w)).sum::<f64>() - minus_p_ln_p(p);
            }
            *slot = normalised(nats, actions);
        }
    }
}

impl Outlook {
    fn new(model: &Pomdp, action: usize) -> Self {
        let states = model.states().len();
        let mut outlook = Self {
            ends: Vec::with_capacity(states),
            entries: Vec::new(),
            columns: Vec::new(),
            mass: vec![0.0; states],
            noise: vec![0.0; states],
        };
        for s in 0..states {
            outlook.entries.extend(model.successors(s, action));
            outlook.ends.push(outlook.entries.len());
        }
        for z in 0..model.observations().len() {
            let column = model.likelihood(action, z);
            if column.iter().any(|p| *p > 0.0) {
                outlook.columns.extend(column);
            }
            for ((mass, noise), p) in outlook.mass.iter_mut().zip(&mut outlook.noise).zip(column) {
                *mass += p;
                *noise += minus_p_ln_p(*p);
            }
        }
        outlook
    }

    /// b'(s') = sum_s T(s,a,s') b(s).
    fn foresee(&self, belief: &[f64], next: &mut [f64]) {
        next.fill(0.0);
        let mut start = 0;
        for (b, end) in belief.iter().zip(&self.ends) {
            if *b > 0.0 {
                for (to, p) in &self.entries[start..*end] {
                    next[*to] += b * p;
                }
            }
            start = *end;
        }
    }
}
