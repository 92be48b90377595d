//! Detection without a blind spot: nominal against nominal plus an unknown constant bias.
//!
//! A constant likelihood never accumulates evidence for a fault whose residual is small in every
//! step. Here the fault state learns the bias of the whitened residual `r`: one component per
//! onset, with a log-weight, a mean bias and a scalar variance; per step a newborn enters and every
//! component is conditioned on `r` (a Kalman filter of a constant). The log-odds are the logarithm
//! of the summed weights: with equal births a Shiryaev-Roberts statistic.
//!
//! Onsets are resolved in proportion to their age ([`crate::onsets`]); where two components become
//! one, their first two moments are kept.
//!
//! Residuals whose number of dimensions only a model tells stand in the first ones of a longer
//! vector, the rest 0: [`Ages::with_dimensions`].
//!
//! One prior deviation serves faults of every size: it enters the delay by its
//! logarithm only, and mixtures of several gained on small faults what they lost on others.

use nalgebra::SVector;

use crate::logspace::{log_add, probability};
use crate::onsets::{Onset, Onsets};
use crate::outlier::SPREAD;

/// Log-odds beyond which more evidence changes nothing. The exponential of more is no double.
pub const LOG_ODDS_MAX: f64 = 700.0;

/// A whitened residual.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct WhitenedResidual<const D: usize> {
    /// The residual over its standard deviation.
    pub value: SVector<f64, D>,
    /// By how much a bias of one unit moves it: 1 at the usual noise, less where more is uncertain.
    pub exposure: f64,
    /// Probability that it is an outlier, whether the fault is there or not: it is evidence only as
    /// far as one state explains it and the other does not.
    pub outlier_rate: f64,
}

impl<const D: usize> WhitenedResidual<D> {
    /// One with no more than the usual noise, and no outlier.
    #[must_use]
    pub const fn usual(value: SVector<f64, D>) -> Self {
        Self {
            value,
            exposure: 1.0,
            outlier_rate: 0.0,
        }
    }
}

impl WhitenedResidual<1> {
    /// A residual of this variance, of which the part `passing` is there for the moment only.
    #[must_use]
    pub fn new(apart: f64, variance: f64, passing: f64, outlier_rate: f64) -> Self {
        let usual = (variance - passing).max(0.0);
        Self {
            value: SVector::from([apart / variance.sqrt()]),
            exposure: (usual / variance).sqrt(),
            outlier_rate,
        }
    }
}

/// A fault that began at one of some successive steps.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Component<const D: usize> {
    log_weight: f64,
    bias: SVector<f64, D>,
    variance: f64,
    /// How many of the D dimensions are used.
    dimensions: f64,
}

/// Learned-bias detection filter over a whitened residual of D dimensions.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Ages<const D: usize> {
    components: Onsets<Component<D>>,
    prior_variance: f64,
    dimensions: f64,
    log_odds: f64,
    gain: f64,
}

impl<const D: usize> Ages<D> {
    /// No fault yet; a newborn fault's bias has the standard deviation `bias_sd` in units of the
    /// residual's.
    #[must_use]
    pub fn new(bias_sd: f64) -> Self {
        Self::with_dimensions(D, bias_sd)
    }

    /// The same over residuals of the first `dimensions` of D, at most D; all others must be 0.
    #[must_use]
    pub fn with_dimensions(dimensions: usize, bias_sd: f64) -> Self {
        Self {
            components: Onsets::default(),
            prior_variance: bias_sd * bias_sd,
            dimensions: dimensions.min(D) as f64,
            log_odds: f64::NEG_INFINITY,
            gain: 0.0,
        }
    }

    /// Natural log-odds of the fault state.
    #[must_use]
    pub const fn log_odds(&self) -> f64 {
        self.log_odds.clamp(-LOG_ODDS_MAX, LOG_ODDS_MAX)
    }

    /// What the last step said for a fault that was there, and is: the logarithm of the
    /// likelihoods' ratio.
    #[must_use]
    pub const fn gain(&self) -> f64 {
        self.gain
    }

    /// One step with the whitened residual and the probability `birth` that a fault appears in it.
    /// A residual that is not finite is no evidence.
    pub fn step(&mut self, residual: &SVector<f64, D>, birth: f64) {
        self.take(&WhitenedResidual::usual(*residual), birth);
    }

    /// The same of a residual that is not like the others.
    pub fn take(&mut self, residual: &WhitenedResidual<D>, birth: f64) {
        let square = residual.value.norm_squared();
        if !(square.is_finite() && residual.exposure.is_finite()) {
            return;
        }
        let (nominal, _) = contaminated(square, residual.outlier_rate, self.dimensions);
        self.components.enter(Component {
            log_weight: birth.ln(),
            bias: SVector::zeros(),
            variance: self.prior_variance,
            dimensions: self.dimensions,
        });
        let stays = (-birth).ln_1p();
        let mut highest = f64::NEG_INFINITY;
        for component in self.components.iter_mut() {
            component.take(residual, nominal);
            component.log_weight -= stays;
            highest = highest.max(component.log_weight);
        }
        let before = log_add(self.log_odds, birth.ln()) - stays;
        let log_weights = self.components.iter().map(|component| component.log_weight);
        self.log_odds = log_weights.fold(f64::NEG_INFINITY, log_add);
        self.gain = self.log_odds - before;
        let excess = (highest - LOG_ODDS_MAX).max(0.0);
        if excess > 0.0 {
            for component in self.components.iter_mut() {
                component.log_weight -= excess;
            }
            self.log_odds -= excess;
        }
    }
}

/// Of the square of a whitened residual that is an outlier with the probability `rate`: the square
/// that has its density where there are no outliers, and the variance of the noise by that. An
/// outlier has ten times the deviation of the whole residual: a bias that is not known yet widens
/// it, so that a channel that reads anything keeps its evidence.
fn contaminated(square: f64, rate: f64, dimensions: f64) -> (f64, f64) {
    if rate <= 0.0 || !square.is_finite() {
        return (square, 1.0);
    }
    let wide = SPREAD * SPREAD;
    let usual = (-rate).ln_1p() - 0.5 * square;
    let far = rate.ln() - dimensions * SPREAD.ln() - 0.5 * square / wide;
    let p = probability(far - usual);
    (-2.0 * log_add(usual, far), 1.0 / (1.0 - p + p / wide))
}

impl<const D: usize> Component<D> {
    /// Conditions on a residual: the weight's ratio to the nominal density, then the bias.
    fn take(&mut self, residual: &WhitenedResidual<D>, nominal: f64) {
        let exposure = residual.exposure;
        let shown = exposure * exposure * self.variance;
        let spread = 1.0 + shown;
        let deviation = residual.value - self.bias * exposure;
        let square = deviation.norm_squared() / spread;
        let (own, variance) = contaminated(square, residual.outlier_rate, self.dimensions);
        self.log_weight += 0.5 * (nominal - own) - 0.5 * self.dimensions * spread.ln();
        let gain = exposure * self.variance / (shown + variance);
        self.bias += gain * deviation;
        self.variance *= 1.0 - gain * exposure;
    }
}

impl<const D: usize> Onset for Component<D> {
    /// Keeps the weight and the first two moments of both.
    fn merged(&self, older: &Self) -> Self {
        let total = log_add(self.log_weight, older.log_weight);
        if total == f64::NEG_INFINITY {
            return *self;
        }
        let (one, two) = (
            (self.log_weight - total).exp(),
            (older.log_weight - total).exp(),
        );
        let apart = (self.bias - older.bias).norm_squared() / self.dimensions.max(1.0);
        // A distance beyond all numbers, after residuals beyond all sense, says nothing.
        let between = if one * two > 0.0 && apart.is_finite() {
            one * two * apart
        } else {
            0.0
        };
        Self {
            log_weight: total,
            bias: self.bias * one + older.bias * two,
            variance: one * self.variance + two * older.variance + between,
            dimensions: self.dimensions,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::logspace::log_sum_exp;
    use proptest::prelude::*;
    use rand::{RngExt, SeedableRng};
    use rand_distr::StandardNormal;

    /// Mean number of steps until the log-odds exceed `alarm`, over `runs` seeded runs.
    fn delay(lambda: f64, alarm: f64, runs: u64, steps_max: usize) -> f64 {
        let mut total = 0;
        for seed in 0..runs {
            let mut rng = rand_pcg::Pcg64Mcg::seed_from_u64(seed);
            let mut filter = Ages::<3>::new(1.0);
            let bias = SVector::from([lambda.sqrt(), 0.0, 0.0]);
            total += 1
                + (0..steps_max)
                    .position(|_| {
                        let noise = SVector::<f64, 3>::from_fn(|_, _| rng.sample(StandardNormal));
                        filter.step(&(noise + bias), 1e-6);
                        filter.log_odds() > alarm
                    })
                    .unwrap_or(steps_max);
        }
        total as f64 / runs as f64
    }

    #[test]
    fn delays_stay_near_the_bound_at_one_false_alarm_in_ten_thousand_steps() {
        // A threshold near this one gives 1e4 steps between false alarms at birth 1e-6.
        let alarm = 8.42 + 1e-6_f64.ln();
        let between_alarms = delay(0.0, alarm, 60, 60_000);
        assert!((4e3..3e4).contains(&between_alarms), "{between_alarms}");
        for lambda in [0.05, 0.1, 0.25, 0.5, 1.0, 2.0] {
            let mean = delay(lambda, alarm, 300, 2000);
            // Lorden, Ann. Math. Stat. 42 (1971) 1897: ln(ARL0) over the information per step.
            let bound = 2.0 * 1e4_f64.ln() / lambda;
            assert!(
                (0.9 * bound..1.35 * bound).contains(&mean),
                "{lambda}: {mean} steps, bound {bound}"
            );
        }
    }

    #[test]
    fn dimensions_that_are_not_used_change_nothing() {
        let (mut short, mut long) = (Ages::<2>::new(1.5), Ages::<5>::with_dimensions(2, 1.5));
        let mut rng = rand_pcg::Pcg64Mcg::seed_from_u64(4);
        for step in 0..200 {
            let bias = if step < 150 { 0.0 } else { 1.0 };
            let [x, y]: [f64; 2] =
                std::array::from_fn(|_| bias + rng.sample::<f64, _>(StandardNormal));
            short.step(&SVector::from([x, y]), 1e-4);
            long.step(&SVector::from([x, y, 0.0, 0.0, 0.0]), 1e-4);
            assert!((short.log_odds() - long.log_odds()).abs() < 1e-9);
        }
        assert!(short.log_odds() > 5.0);
    }

    #[test]
    fn a_bias_stays_one_where_much_is_uncertain() {
        // A bias of 20 usual deviations, and residuals of noise 1; in a tenth of them ten times as
        // much is uncertain, so that the bias shows as two deviations.
        let mut filter = Ages::<1>::new(30.0);
        let mut rng = rand_pcg::Pcg64Mcg::seed_from_u64(5);
        let mut against = 0.0_f64;
        for step in 0..500 {
            let exposure = if step % 10 == 9 { 0.1 } else { 1.0 };
            let noise: f64 = rng.sample(StandardNormal);
            let residual = WhitenedResidual {
                value: SVector::from([20.0 * exposure + noise]),
                exposure,
                outlier_rate: 1e-6,
            };
            filter.take(&residual, 1e-6);
            against = against.min(filter.gain());
        }
        assert!(filter.log_odds() > 600.0);
        assert!(
            against > -5.0,
            "a single reading speaks against it: {against}"
        );
    }

    #[test]
    fn the_first_step_is_the_marginal_likelihood_ratio() {
        let mut filter = Ages::<1>::new(2.0);
        filter.step(&SVector::from([3.0]), 0.01);
        let ratio = crate::logspace::log_normal(3.0, 5.0) - crate::logspace::log_normal(3.0, 1.0);
        assert!((filter.log_odds() - (ratio + (0.01_f64 / 0.99).ln())).abs() < 1e-12);
    }

    /// Sum over every onset so far of birth times marginal likelihood ratio, from plain sums:
    /// `(1 + nξ²)^(-D/2) exp(ξ²|S|² / (2 (1 + nξ²)))` after n residuals that add up to S.
    fn every_onset(residuals: &[SVector<f64, 3>], bias_sd: f64, birth: f64) -> f64 {
        let mut sum = SVector::<f64, 3>::zeros();
        let mut terms = Vec::new();
        for (age, residual) in residuals.iter().rev().enumerate() {
            sum += residual;
            let n = age as f64 + 1.0;
            let spread = 1.0 + n * bias_sd * bias_sd;
            terms.push(
                0.5 * bias_sd * bias_sd * sum.norm_squared() / spread - 1.5 * spread.ln()
                    + birth.ln()
                    - n * (1.0 - birth).ln(),
            );
        }
        log_sum_exp(&terms)
    }

    #[test]
    fn sharing_components_between_onsets_costs_little_against_every_onset() {
        for (lambda, onset) in [(0.0, 0), (0.25, 130), (1.0, 37), (1.0, 200)] {
            let mut rng = rand_pcg::Pcg64Mcg::seed_from_u64(8);
            let mut filter = Ages::<3>::new(1.0);
            let mut residuals = Vec::new();
            for step in 0..300 {
                let bias: f64 = if step < onset { 0.0 } else { lambda };
                let noise = SVector::<f64, 3>::from_fn(|_, _| rng.sample(StandardNormal));
                residuals.push(noise + SVector::from([0.0, bias.sqrt(), 0.0]));
                filter.step(&residuals[step], 1e-3);
                let apart = filter.log_odds() - every_onset(&residuals, 1.0, 1e-3);
                let allowed = if step < 2 { 1e-12 } else { 0.7 };
                assert!(apart.abs() < allowed, "{lambda}, step {step}: {apart}");
            }
        }
    }

    proptest! {
        #[test]
        fn no_residual_breaks_the_filter(values in prop::collection::vec(any::<f64>(), 1..60)) {
            let mut filter = Ages::<1>::new(1.0);
            for value in values {
                filter.step(&SVector::from([value]), 1e-6);
                prop_assert!(filter.log_odds().is_finite());
            }
        }
    }
}
