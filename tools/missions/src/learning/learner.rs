//! The iteration.

use rand::SeedableRng;
use rand_pcg::Pcg64Mcg;

use super::expectation::{Impossible, Passes};
use super::information::Information;
use super::layout::Layout;
use super::learned::{Iteration, LearnedModel};
use super::record::{Record, RecordError};
use super::starts;
use vigil_pomdp::ParseError;
use vigil_pomdp::Pomdp;

/// How to learn.
#[derive(Debug, Clone, PartialEq)]
pub struct Settings {
    /// K: each row of the prior counts as much as so many visits. 0: the likelihood alone.
    pub prior_strength: f64,
    /// Iterations at most, of each start.
    pub iterations_max: usize,
    /// Ends when an iteration raises the objective by less than this, nats per recorded step.
    pub rise_min: f64,
    /// Starts: the first is the prior's model, others are drawn around it; the best one counts.
    pub starts: usize,
    /// Seed of the drawn starts.
    pub seed: u64,
}

impl Default for Settings {
    /// K = 50, 1000 iterations, 1e-9 nats, one start.
    fn default() -> Self {
        Self {
            prior_strength: 50.0,
            iterations_max: 1000,
            rise_min: 1e-9,
            starts: 1,
            seed: 1,
        }
    }
}

/// Why nothing was learned.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum LearnError {
    /// No step in any mission.
    #[error("no recorded step: allowed are one mission of one step or more")]
    Empty,
    /// A setting out of range.
    #[error("{what} {found}: allowed is {allowed}")]
    Setting {
        /// Which one.
        what: &'static str,
        /// What was given.
        found: f64,
        /// What would do.
        allowed: &'static str,
    },
    /// A mission does not fit the model.
    #[error("mission {mission} (from 0): {problem}")]
    Record {
        /// Which one, from 0.
        mission: usize,
        /// What is wrong.
        problem: RecordError,
    },
    /// A mission cannot happen by the model.
    #[error("mission {mission} (from 0): {problem}")]
    Impossible {
        /// Which one, from 0.
        mission: usize,
        /// Where.
        problem: Impossible,
    },
    /// Rewards overflow with the learned probabilities.
    #[error("the learned model: {0}")]
    Model(ParseError),
}

/// Learns from missions, anchored at `prior`; `watch` is shown every iteration.
///
/// # Errors
/// [`LearnError`].
pub fn learn(
    prior: &Pomdp,
    records: &[Record],
    settings: &Settings,
    watch: &mut dyn FnMut(Iteration),
) -> Result<LearnedModel, LearnError> {
    checked(prior, records, settings)?;
    let (layout, hand) = Layout::new(prior);
    let kappa: Vec<f64> = hand.iter().map(|p| p * settings.prior_strength).collect();
    let mut search = Search::new(&layout, &kappa, records);
    let mut generator = Pcg64Mcg::seed_from_u64(settings.seed);
    let mut best: Option<(f64, usize, Vec<f64>)> = None;
    let mut iterations = Vec::new();
    for start in 0..settings.starts {
        let mut theta = match start {
            0 => hand.clone(),
            _ => starts::around(&layout, &hand, &mut generator),
        };
        let objective = search.climb(&mut theta, settings, &mut |iteration, like, objective| {
            let iteration = Iteration {
                start,
                iteration,
                log_likelihood: like,
                objective,
            };
            iterations.push(iteration);
            watch(iteration);
        })?;
        if best.as_ref().is_none_or(|best| objective > best.0) {
            best = Some((objective, start, theta));
        }
    }
    let (_, start, theta) = best.ok_or(LearnError::Empty)?;
    let (counts, worth) = search.information(&theta)?;
    let model = layout.model(prior, &theta).map_err(LearnError::Model)?;
    Ok(LearnedModel {
        model,
        iterations,
        start,
        layout,
        hand,
        kappa,
        theta,
        counts,
        worth,
    })
}

fn checked(prior: &Pomdp, records: &[Record], settings: &Settings) -> Result<(), LearnError> {
    let count = |n: usize| n as f64;
    let ranges = [
        ("prior strength", settings.prior_strength, 0.0, "0 or more"),
        (
            "iterations",
            count(settings.iterations_max),
            1.0,
            "1 or more",
        ),
        ("least rise", settings.rise_min, 0.0, "0 or more"),
        ("starts", count(settings.starts), 1.0, "1 or more"),
    ];
    for (what, found, least, allowed) in ranges {
        if !(found.is_finite() && found >= least) {
            return Err(LearnError::Setting {
                what,
                found,
                allowed,
            });
        }
    }
    for (mission, record) in records.iter().enumerate() {
        let checked = record.check(prior);
        checked.map_err(|problem| LearnError::Record { mission, problem })?;
    }
    if records.iter().all(|record| record.steps() == 0) {
        return Err(LearnError::Empty);
    }
    Ok(())
}

/// What the iterations share.
struct Search<'a> {
    layout: &'a Layout,
    kappa: &'a [f64],
    records: &'a [Record],
    passes: Passes,
    counts: Vec<f64>,
}

impl<'a> Search<'a> {
    fn new(layout: &'a Layout, kappa: &'a [f64], records: &'a [Record]) -> Self {
        Self {
            layout,
            kappa,
            records,
            passes: Passes::default(),
            counts: vec![0.0; kappa.len()],
        }
    }

    /// Improves `theta` until it hardly rises; returns the objective of the last iteration, which
    /// that of `theta` is not below.
    ///
    /// Where states are hard to tell, the iteration creeps. Hence after two steps, r and then
    /// r + v, a long one is tried: theta + 2 l r + l^2 v, l = |r| / |v| (Varadhan and Roland 2008,
    /// "SQUAREM"); it counts only if the objective has risen there, too. Hence the last iteration
    /// ends in a plain step: nothing would look at a long one any more.
    fn climb(
        &mut self,
        theta: &mut Vec<f64>,
        settings: &Settings,
        watch: &mut dyn FnMut(usize, f64, f64),
    ) -> Result<f64, LearnError> {
        let steps: usize = self.records.iter().map(Record::steps).sum();
        let rise_min = settings.rise_min * steps as f64;
        let mut last = f64::NEG_INFINITY;
        let mut trail: Vec<Vec<f64>> = Vec::new();
        for iteration in 0..settings.iterations_max {
            let mut likelihood = self.count(theta);
            if trail.len() == 3 {
                // Here theta is the long step, and the trail's end what it has to beat.
                let objective = likelihood
                    .as_ref()
                    .map(|l| l + log_prior(self.kappa, theta));
                if objective.map_or(true, |objective| objective < last) {
                    *theta = trail.pop().unwrap_or_default();
                    likelihood = self.count(theta);
                }
                trail.clear();
            }
            let likelihood = likelihood?;
            let objective = likelihood + log_prior(self.kappa, theta);
            watch(iteration, likelihood, objective);
            if objective - last <= rise_min {
                return Ok(objective);
            }
            last = objective;
            trail.push(theta.clone());
            self.maximise(theta);
            if trail.len() == 2 && iteration + 1 < settings.iterations_max {
                trail.push(theta.clone());
                self.leap(&trail, theta);
            }
        }
        Ok(last)
    }

    /// The long step along three points of the `trail`, rows kept distributions: no probability
    /// falls below a tenth of the last point's.
    fn leap(&self, trail: &[Vec<f64>], theta: &mut [f64]) {
        let [first, second, third] = trail else {
            return;
        };
        let (mut rr, mut vv) = (0.0, 0.0);
        for ((a, b), c) in first.iter().zip(second).zip(third) {
            rr += (b - a).powi(2);
            vv += (c - b - (b - a)).powi(2);
        }
        let length = (rr / vv).sqrt();
        if !(length > 1.0 && length.is_finite()) {
            return;
        }
        for (index, value) in theta.iter_mut().enumerate() {
            let (a, b, c) = (first[index], second[index], third[index]);
            let (r, v) = (b - a, c - b - (b - a));
            *value = (a + 2.0 * length * r + length * length * v).max(0.1 * c);
        }
        for row in self.layout.rows() {
            let sum: f64 = theta[row.clone()].iter().sum();
            theta[row].iter_mut().for_each(|value| *value /= sum);
        }
    }

    /// Expected counts of all missions; returns the log-likelihood.
    fn count(&mut self, theta: &[f64]) -> Result<f64, LearnError> {
        self.counts.fill(0.0);
        let mut sum = 0.0;
        for (mission, record) in self.records.iter().enumerate() {
            let counts = &mut self.counts;
            let found = self.passes.run(self.layout, theta, record, counts);
            sum += found.map_err(|problem| LearnError::Impossible { mission, problem })?;
        }
        Ok(sum)
    }

    /// theta = (N + kappa) / sum. A row without either stays.
    fn maximise(&self, theta: &mut [f64]) {
        for row in self.layout.rows() {
            let weight = |at: usize| self.counts[at] + self.kappa[at];
            let sum: f64 = row.clone().map(weight).sum();
            if sum > 0.0 {
                row.for_each(|at| theta[at] = weight(at) / sum);
            }
        }
    }

    /// Expected counts of all missions, and what they tell of each probability.
    fn information(&mut self, theta: &[f64]) -> Result<(Vec<f64>, Vec<f64>), LearnError> {
        let mut information = Information::new(self.layout, theta);
        let (mut total, mut own) = (vec![0.0; theta.len()], vec![0.0; theta.len()]);
        for (mission, record) in self.records.iter().enumerate() {
            own.fill(0.0);
            let found = self.passes.run(self.layout, theta, record, &mut own);
            found.map_err(|problem| LearnError::Impossible { mission, problem })?;
            total.iter_mut().zip(&own).for_each(|(sum, n)| *sum += n);
            information.add(&own);
        }
        Ok((total, information.visits(self.kappa)))
    }
}

/// sum kappa ln theta; what has no kappa counts nothing.
fn log_prior(kappa: &[f64], theta: &[f64]) -> f64 {
    let pairs = kappa.iter().zip(theta).filter(|(kappa, _)| **kappa > 0.0);
    pairs.map(|(kappa, theta)| kappa * theta.ln()).sum()
}
