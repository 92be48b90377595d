//! Chances that are counted, with what was thought before.
//!
//! A chance p made by hand counts as K visits: after k of n it is (k + K p) / (n + K), the mean of
//! a beta distribution (Gelman et al., *Bayesian Data Analysis*, section 2.4). A chance that is 0
//! by hand is ruled out and stays so.

use statrs::distribution::{Beta, ContinuousCDF};

/// A number that was fitted.
#[derive(Debug, Clone, PartialEq, serde::Serialize, schemars::JsonSchema)]
pub struct FittedChance {
    /// Where it stands in the file, or what it is a chance of.
    pub key: String,
    /// The number in the file.
    pub by_hand: f64,
    /// The fitted number.
    pub fitted: f64,
    /// Bounds of its 95 % credible interval, as if steps were independent and counts seen.
    pub interval: [f64; 2],
    /// How often it was so in the missions.
    pub count: f64,
    /// How often it might have been so.
    pub visits: f64,
}

/// Fitted parameters, and where each number comes from.
#[derive(Debug, Clone, PartialEq)]
pub struct Fit<P> {
    /// The parameters.
    pub parameters: P,
    /// Numbers that were visited, in the order of the file.
    pub chances: Vec<FittedChance>,
    /// Steps that were counted.
    pub steps: usize,
}

/// k of n visits.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Count {
    pub k: f64,
    pub n: f64,
}

impl Count {
    /// What the counts and a chance by hand that is worth `weight` visits make together.
    pub(crate) fn mean(self, by_hand: f64, weight: f64) -> f64 {
        let visits = self.n + weight;
        match visits > 0.0 && by_hand > 0.0 {
            true => (self.k + weight * by_hand) / visits,
            false => by_hand,
        }
    }

    /// Of the steps for which `is_visit` holds, those for which `is_so` does.
    pub(crate) fn among<S>(
        steps: &[S],
        is_visit: impl Fn(&S) -> bool,
        is_so: impl Fn(&S) -> bool,
    ) -> Self {
        let visits: Vec<&S> = steps.iter().filter(|step| is_visit(step)).collect();
        Self {
            k: visits.iter().filter(|step| is_so(step)).count() as f64,
            n: visits.len() as f64,
        }
    }
}

/// Chances as they are fitted, by a weight K of what was thought before.
pub(crate) struct FittedChances {
    weight: f64,
    chances: Vec<FittedChance>,
}

impl FittedChances {
    pub(crate) const fn new(weight: f64) -> Self {
        Self {
            weight,
            chances: Vec::new(),
        }
    }

    /// What the counts make of a chance, if it is not ruled out.
    pub(crate) fn fit_chance(&mut self, key: String, by_hand: f64, count: Count) -> f64 {
        if by_hand <= 0.0 || count.n == 0.0 {
            return by_hand;
        }
        let (yes, no) = (
            count.k + self.weight * by_hand,
            count.n - count.k + self.weight * (1.0 - by_hand),
        );
        let fitted = count.mean(by_hand, self.weight);
        let bound = |p| match Beta::new(yes, no) {
            Ok(beta) => beta.inverse_cdf(p),
            Err(_) => fitted,
        };
        self.chances.push(FittedChance {
            key,
            by_hand,
            fitted,
            interval: [bound(0.025), bound(0.975)],
            count: count.k,
            visits: count.n,
        });
        fitted
    }

    /// Sets a chance to it.
    pub(crate) fn set(&mut self, key: String, chance: &mut f64, count: Count) {
        *chance = self.fit_chance(key, *chance, count);
    }

    pub(crate) fn finish(self) -> Vec<FittedChance> {
        self.chances
    }
}
