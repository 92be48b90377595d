//! Learning on the way: a Dirichlet posterior over models, sampled and updated mission by mission.
//!
//! Posterior sampling (Thompson 1933; Strens 2000; over POMDPs MEDUSA: Jaulmes, Pineau, Precup
//! 2005): before each mission a model is drawn from what is known, and the robot acts as if it were
//! the true one. What is uncertain differs from draw to draw, so that the robot tries it; what is
//! known does not. After the mission the expected counts of *all* missions are taken anew, as later
//! missions may tell what happened in earlier ones.

use rand::Rng;

use super::layout::Layout;
use super::learner::{LearnError, Search};
use super::record::{Record, RecordError};
use super::sampling;
use vigil_pomdp::Pomdp;

/// What is known of a world's probabilities.
#[derive(Debug, Clone)]
pub struct Posterior {
    prior: Pomdp,
    layout: Layout,
    kappa: Vec<f64>,
    /// Expected counts of all missions.
    counts: Vec<f64>,
    /// The most probable model in the sense of [`super::learn`].
    theta: Vec<f64>,
    records: Vec<Record>,
}

impl Posterior {
    /// Nothing but the prior is known; each of its rows counts as much as `strength` visits.
    ///
    /// # Errors
    /// [`LearnError::Setting`] if the strength is not positive.
    pub fn new(prior: &Pomdp, strength: f64) -> Result<Self, LearnError> {
        if !(strength.is_finite() && strength > 0.0) {
            return Err(LearnError::Setting {
                what: "prior strength",
                found: strength,
                allowed: "a positive number",
            });
        }
        let (layout, theta) = Layout::new(prior);
        Ok(Self {
            prior: prior.clone(),
            kappa: theta.iter().map(|p| p * strength).collect(),
            counts: vec![0.0; theta.len()],
            layout,
            theta,
            records: Vec::new(),
        })
    }

    /// A model drawn from Dirichlet(kappa + N), row by row.
    ///
    /// # Errors
    /// [`LearnError::Model`].
    pub fn sample(&self, generator: &mut impl Rng) -> Result<Pomdp, LearnError> {
        let weights: Vec<f64> = self
            .kappa
            .iter()
            .zip(&self.counts)
            .map(|(k, n)| k + n)
            .collect();
        let drawn = sampling::dirichlet(&self.layout, &weights, &self.theta, generator);
        let model = self.layout.model(&self.prior, &drawn);
        model.map_err(LearnError::Model)
    }

    /// The mean of what [`Self::sample`] draws.
    ///
    /// # Errors
    /// [`LearnError::Model`].
    pub fn mean(&self) -> Result<Pomdp, LearnError> {
        let model = self.layout.model(&self.prior, &self.theta);
        model.map_err(LearnError::Model)
    }

    /// Missions so far.
    #[must_use]
    pub fn missions(&self) -> usize {
        self.records.len()
    }

    /// Adds a mission, and takes the expected counts of all of them `sweeps` times (1 or more),
    /// each time under the model that follows from the time before.
    ///
    /// # Errors
    /// [`LearnError`]; the mission then is left out.
    pub fn absorb(&mut self, record: Record, sweeps: usize) -> Result<(), LearnError> {
        let mission = self.records.len();
        let fits: Result<(), RecordError> = record.check(&self.prior);
        fits.map_err(|problem| LearnError::Record { mission, problem })?;
        self.records.push(record);
        let mut theta = self.theta.clone();
        let mut search = Search::new(&self.layout, &self.kappa, &self.records);
        for _ in 0..sweeps.max(1) {
            if let Err(error) = search.count(&theta) {
                self.records.pop();
                return Err(error);
            }
            search.maximise(&mut theta);
        }
        self.counts = search.into_counts();
        self.theta = theta;
        Ok(())
    }
}
