//! The beliefs that may follow upon a belief.

use crate::model::Pomdp;

/// Working memory: one number per state, and a sparse belief.
#[derive(Debug, Clone, Default)]
pub(super) struct Followers {
    predicted: Vec<f64>,
    belief: Vec<(u32, f64)>,
}

/// A belief that may follow, with the probability of its observation.
pub(super) struct Follower<'a> {
    pub observation: usize,
    pub probability: f64,
    pub belief: &'a [(u32, f64)],
}

impl Followers {
    /// Hands every belief that may follow upon `belief` and `action` to `take`, by its observation;
    /// returns the work done.
    pub(super) fn each<E>(
        &mut self,
        model: &Pomdp,
        belief: &[(u32, f64)],
        action: usize,
        mut take: impl FnMut(Follower<'_>) -> Result<(), E>,
    ) -> Result<usize, E> {
        self.predicted.clear();
        self.predicted.resize(model.states().len(), 0.0);
        let mut work = self.predicted.len() * (1 + model.observations().len());
        for (s, b) in belief {
            let successors = model.moves(*s as usize, action);
            work += successors.len();
            for (to, p) in successors {
                self.predicted[*to] += b * p;
            }
        }
        for observation in 0..model.observations().len() {
            let likelihood = model.likelihood(action, observation).iter();
            let weights = self.predicted.iter().zip(likelihood).enumerate();
            self.belief.clear();
            self.belief.extend(weights.filter_map(|(s, (b, z))| {
                let w = b * z;
                (w > 0.0).then_some((s as u32, w))
            }));
            let probability: f64 = self.belief.iter().map(|(_, w)| w).sum();
            if probability <= 0.0 {
                continue;
            }
            self.belief.iter_mut().for_each(|(_, w)| *w /= probability);
            take(Follower {
                observation,
                probability,
                belief: &self.belief,
            })?;
        }
        Ok(work)
    }
}
