//! Belief tracking.

use pyo3::prelude::*;
use vigil_pomdp::{Evidence, Pomdp};

use crate::errors::refusal;
use crate::model::Model;
use crate::names::Key;

/// A belief sums to 1 within this.
const SUM_TOLERANCE: f64 = 1e-6;

/// The exact belief over the states of a model; it begins at the model's start belief.
#[pyclass(module = "vigil_pomdp")]
pub struct Tracker {
    model: Model,
    tracker: vigil_pomdp::Tracker,
}

/// The probability of what was observed; 0 if it was impossible.
const fn probability(evidence: Evidence) -> f64 {
    match evidence {
        Evidence::Taken(p) => p,
        Evidence::Impossible => 0.0,
    }
}

fn check_length(what: &str, found: usize, model: &Pomdp) -> PyResult<()> {
    let states = model.states().len();
    if found == states {
        return Ok(());
    }
    Err(refusal(format!(
        "the {what} has {found} entries, allowed are {states}, one a state"
    )))
}

#[pymethods]
impl Tracker {
    #[new]
    fn new(model: Model) -> Self {
        Self {
            tracker: vigil_pomdp::Tracker::new(&model.pomdp),
            model,
        }
    }

    /// Takes an action and what was observed after it; returns the probability p(z|a,b) that the
    /// observation had before.
    ///
    /// It is 0 if the observation was impossible. The belief is then the prediction, with 0.01 of
    /// the start belief mixed in, so that no state is ruled out for ever.
    fn update(&mut self, action: Key, observation: Key) -> PyResult<f64> {
        let model = &self.model;
        let (action, observation) = (model.action(&action)?, model.observation(&observation)?);
        let evidence = self.tracker.update(&model.pomdp, action, observation);
        Ok(probability(evidence))
    }

    /// Takes an action of which nothing was observed.
    fn predict(&mut self, action: Key) -> PyResult<()> {
        let action = self.model.action(&action)?;
        self.tracker.predict(&self.model.pomdp, action);
        Ok(())
    }

    /// Soft evidence: multiplies the belief by a likelihood for each state. Returns the expected
    /// likelihood; 0 if nothing is left, and the belief then as after an impossible observation.
    fn weigh(&mut self, likelihoods: Vec<f64>) -> PyResult<f64> {
        check_length("list of likelihoods", likelihoods.len(), &self.model.pomdp)?;
        Ok(probability(self.tracker.weigh(&likelihoods)))
    }

    /// Back to the start belief.
    fn reset(&mut self) {
        self.tracker.reset();
    }

    /// The belief: one probability a state, non-negative, summing to 1. Can be set.
    #[getter]
    fn belief(&self) -> Vec<f64> {
        self.tracker.belief().to_vec()
    }

    #[setter]
    fn set_belief(&mut self, belief: Vec<f64>) -> PyResult<()> {
        let belief = checked(belief, &self.model.pomdp)?;
        self.tracker.anchor(&belief);
        Ok(())
    }

    /// The probability of a state.
    fn probability(&self, state: Key) -> PyResult<f64> {
        let state = state.index("state", self.model.pomdp.states())?;
        Ok(self.tracker.belief()[state])
    }

    /// Entropy of the belief, divided by that of the uniform one: 0 certain, 1 uniform.
    #[getter]
    fn entropy(&self) -> f64 {
        self.tracker.entropy()
    }

    /// The model.
    #[getter]
    fn model(&self) -> Model {
        self.model.clone()
    }

    fn __repr__(&self) -> String {
        let belief = self.tracker.belief().iter();
        let all = self.model.pomdp.states().iter().zip(belief);
        let mut likely: Vec<(&String, &f64)> = all.filter(|(_, b)| **b > 0.0).collect();
        likely.sort_by(|a, b| b.1.total_cmp(a.1));
        let shown = likely
            .iter()
            .take(5)
            .map(|(name, b)| format!("{name} {b:.4}"));
        let dots = if likely.len() > 5 { ", ..." } else { "" };
        format!("<Tracker: {}{dots}>", shown.collect::<Vec<_>>().join(", "))
    }
}

/// A belief: a tracker's, or one probability a state.
#[derive(FromPyObject)]
pub enum Belief<'py> {
    #[pyo3(annotation = "Tracker")]
    OfTracker(PyRef<'py, Tracker>),
    #[pyo3(annotation = "Sequence[float]")]
    List(Vec<f64>),
}

impl Belief<'_> {
    /// Its probabilities, for a policy of `model`.
    pub fn values(self, model: &Pomdp) -> PyResult<Vec<f64>> {
        match self {
            Self::OfTracker(tracker) => checked(tracker.belief(), model),
            Self::List(values) => checked(values, model),
        }
    }
}

fn checked(belief: Vec<f64>, model: &Pomdp) -> PyResult<Vec<f64>> {
    check_length("belief", belief.len(), model)?;
    if let Some(wrong) = belief
        .iter()
        .find(|p| !(0.0..=1.0 + SUM_TOLERANCE).contains(*p))
    {
        let message = format!("the belief holds {wrong}, allowed are probabilities, 0 to 1");
        return Err(refusal(message));
    }
    let sum: f64 = belief.iter().sum();
    if (sum - 1.0).abs() > SUM_TOLERANCE {
        return Err(refusal(format!(
            "the belief sums to {sum}, allowed is 1 within {SUM_TOLERANCE}"
        )));
    }
    Ok(belief)
}
