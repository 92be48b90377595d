//! What was learned, and how much of it is data.

use statrs::distribution::{Beta, ContinuousCDF};

use super::layout::{Layout, Row};
use vigil_pomdp::Pomdp;

/// An iteration of learning, as it began.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, schemars::JsonSchema)]
pub struct Iteration {
    /// Number of the start, from 0.
    pub start: usize,
    /// Number of the iteration, from 0.
    pub iteration: usize,
    /// Log-likelihood of all missions, nats.
    pub log_likelihood: f64,
    /// Log-likelihood with the logarithm of the prior, nats; it rises with each iteration.
    pub objective: f64,
}

/// A learned model and its origin.
#[derive(Debug, Clone)]
pub struct LearnedModel {
    /// The model.
    pub model: Pomdp,
    /// Every iteration of every start.
    pub iterations: Vec<Iteration>,
    /// The start whose model this is, from 0.
    pub start: usize,
    pub(super) layout: Layout,
    pub(super) hand: Vec<f64>,
    pub(super) kappa: Vec<f64>,
    pub(super) theta: Vec<f64>,
    pub(super) counts: Vec<f64>,
    /// Visits that missions and prior together are worth for each probability.
    pub(super) worth: Vec<f64>,
}

/// One row of the learned model.
#[derive(Debug, Clone, PartialEq)]
pub struct LearnedRow {
    /// Which.
    pub row: Row,
    /// Expected visits in the missions.
    pub visits: f64,
    /// Visits that the prior counts as.
    pub prior: f64,
    /// Its probabilities, but for those that the prior rules out.
    pub entries: Vec<Entry>,
}

impl LearnedRow {
    /// visits / (visits + prior): 0 if the row is the prior's, near 1 if it is the missions'.
    #[must_use]
    pub fn data_share(&self) -> f64 {
        let sum = self.visits + self.prior;
        if sum > 0.0 { self.visits / sum } else { 0.0 }
    }
}

/// One probability.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Entry {
    /// s, s' or z.
    pub column: usize,
    /// In the prior's model.
    pub prior: f64,
    /// Learned.
    pub learned: f64,
    /// Visits that the missions are worth for this number. States are hidden: it is fewer than the
    /// row's visits the harder they are to tell.
    pub effective_visits: f64,
    /// The 95 % credible interval: quantiles of Beta(m p, m (1 - p)), p learned, m the effective
    /// visits and the prior's. Credible is not certain: of worlds that the prior expects it holds
    /// 95 in 100; a prior that is off pulls learned numbers along, and it holds fewer.
    pub interval: [f64; 2],
}

impl LearnedModel {
    /// Every row: the start belief, T, Z.
    pub fn rows(&self) -> impl Iterator<Item = LearnedRow> + '_ {
        let rows = self.layout.rows().enumerate();
        rows.map(|(index, places)| {
            let sum = |of: &[f64]| -> f64 { of[places.clone()].iter().sum() };
            let (visits, prior) = (sum(&self.counts), sum(&self.kappa));
            LearnedRow {
                row: self.layout.row(index),
                visits,
                prior,
                entries: places.map(|at| self.entry(at, visits, prior)).collect(),
            }
        })
    }

    fn entry(&self, at: usize, visits: f64, prior: f64) -> Entry {
        let p = self.theta[at];
        let effective = (self.worth[at] - prior).clamp(0.0, visits);
        Entry {
            column: self.layout.columns[at] as usize,
            prior: self.hand[at],
            learned: p,
            effective_visits: effective,
            interval: interval(p, effective + prior),
        }
    }
}

/// 95 % of Beta(m p, m (1 - p)); everything where nothing is known.
fn interval(p: f64, visits: f64) -> [f64; 2] {
    if p <= 0.0 || p >= 1.0 {
        return [p, p];
    }
    let Ok(beta) = Beta::new(visits * p, visits * (1.0 - p)) else {
        return [0.0, 1.0];
    };
    [0.025, 0.975].map(|q| beta.inverse_cdf(q))
}
