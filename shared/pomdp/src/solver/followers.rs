//! The beliefs that may follow upon a belief.

use crate::model::Pomdp;
use crate::model::sparse::Sparse;

/// Z by next state, and working memory.
#[derive(Debug, Clone, Default)]
pub(super) struct Followers {
    /// Per action: for each s' the possible observations and their probabilities.
    seen: Vec<Sparse>,
    /// All 0 between calls.
    predicted: Vec<f64>,
    /// The states that may follow.
    next: Vec<u32>,
    /// For each observation the belief, empty between calls.
    beliefs: Vec<Vec<(u32, f64)>>,
}

/// A belief that may follow, with the probability of its observation.
pub(super) struct Follower<'a> {
    pub observation: usize,
    pub probability: f64,
    pub belief: &'a [(u32, f64)],
}

impl Followers {
    /// For one model, which every call must be given.
    pub(super) fn new(model: &Pomdp) -> Self {
        let (states, observations) = (model.states().len(), model.observations().len());
        let seen = (0..model.actions().len()).map(|a| {
            let mut rows = Sparse::default();
            for s in 0..states {
                rows.push((0..observations).map(|o| (o, model.likelihood(a, o)[s])));
            }
            rows
        });
        Self {
            seen: seen.collect(),
            predicted: vec![0.0; states],
            next: Vec::new(),
            beliefs: vec![Vec::new(); observations],
        }
    }

    /// The possible observations in a state after an action, and their probabilities.
    pub(super) fn seen(&self, action: usize, state: usize) -> &[(usize, f64)] {
        self.seen[action].row(state)
    }

    /// Hands every belief that may follow upon `belief` and `action` to `take`, by its observation;
    /// returns the work done.
    pub(super) fn each<E>(
        &mut self,
        model: &Pomdp,
        belief: &[(u32, f64)],
        action: usize,
        mut take: impl FnMut(Follower<'_>) -> Result<(), E>,
    ) -> Result<usize, E> {
        let mut work = self.predicted.len() * (1 + model.observations().len());
        self.next.clear();
        for (s, b) in belief {
            let successors = model.moves(*s as usize, action);
            work += successors.len();
            for (to, p) in successors {
                if self.predicted[*to] == 0.0 {
                    self.next.push(*to as u32);
                }
                self.predicted[*to] += b * p;
            }
        }
        self.next.sort_unstable();
        self.next.dedup();
        for s in &self.next {
            let b = std::mem::take(&mut self.predicted[*s as usize]);
            for (o, z) in self.seen[action].row(*s as usize) {
                let w = b * z;
                if w > 0.0 {
                    self.beliefs[*o].push((*s, w));
                }
            }
        }
        let mut result = Ok(work);
        for (observation, belief) in self.beliefs.iter_mut().enumerate() {
            let probability: f64 = belief.iter().map(|(_, w)| w).sum();
            if probability > 0.0 && result.is_ok() {
                belief.iter_mut().for_each(|(_, w)| *w /= probability);
                let taken = take(Follower {
                    observation,
                    probability,
                    belief,
                });
                result = taken.and(result);
            }
            belief.clear();
        }
        result
    }
}
