//! Detection without a blind spot: nominal against nominal plus an unknown constant bias.
//!
//! A constant likelihood never accumulates evidence for a fault whose residual is small in every
//! step. Here the fault state learns the bias of the whitened residual `r`. There is one component
//! per onset, with a log-weight, a mean bias and a scalar variance. Each step adds a component, and
//! conditions all on `r` (a Kalman filter of a constant). The log-odds are the logarithm of the
//! summed weights: with equal births a Shiryaev-Roberts statistic.
//!
//! Onsets are resolved in proportion to their age ([`crate::onsets`]). Where two components become
//! one, their first two moments are kept.
//!
//! A residual whose dimension is known only at run time fills the first elements of a longer
//! vector; the others are 0: [`Ages::with_dimensions`].
//!
//! One prior deviation of the bias serves faults of every size: the delay depends on its logarithm
//! only. Mixtures of several gained on small faults what they lost on others.

use nalgebra::SVector;
use vigil_checkpoint::CheckpointValue;

use crate::logspace::{log_add, probability};
use crate::onsets::{Onset, Onsets};
use crate::outlier::SPREAD;

/// Largest log-odds: the exponential of more exceeds a double, and no decision needs it.
pub const LOG_ODDS_MAX: f64 = 700.0;

/// A whitened residual.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct WhitenedResidual<const D: usize> {
    /// The residual over its standard deviation.
    pub value: SVector<f64, D>,
    /// Change of the value by a bias of one unit: 1 at the usual noise, less where more is
    /// uncertain.
    pub exposure: f64,
    /// Probability that it is an outlier, with or without a fault. An outlier under both is
    /// evidence for neither.
    pub outlier_rate: f64,
}

impl<const D: usize> WhitenedResidual<D> {
    /// A residual with the usual noise that is no outlier.
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
    /// A residual of this variance; the part `passing` of the variance exceeds the usual noise, for
    /// this measurement only.
    #[must_use]
    pub fn new(residual: f64, variance: f64, passing: f64, outlier_rate: f64) -> Self {
        let usual = (variance - passing).max(0.0);
        Self {
            value: SVector::from([residual / variance.sqrt()]),
            exposure: (usual / variance).sqrt(),
            outlier_rate,
        }
    }
}

/// A fault that began at one of some successive steps.
#[derive(Debug, Clone, Copy, PartialEq, CheckpointValue)]
struct Component<const D: usize> {
    log_weight: f64,
    bias: SVector<f64, D>,
    variance: f64,
    /// Number of the D dimensions in use.
    dimensions: f64,
}

/// Learned-bias detection filter over a whitened residual of D dimensions.
#[derive(Debug, Clone, Copy, PartialEq, CheckpointValue)]
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

    /// A filter over residuals of `dimensions` elements, at most D; the others must be 0.
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

    /// Log-likelihood ratio of the last step for a fault that was present before it and stays.
    #[must_use]
    pub const fn gain(&self) -> f64 {
        self.gain
    }

    /// One step with the whitened residual and the probability `birth` that a fault appears in it.
    /// A residual that is not finite is no evidence.
    pub fn step(&mut self, residual: &SVector<f64, D>, birth: f64) {
        self.take(&WhitenedResidual::usual(*residual), birth);
    }

    /// One step with a residual that has its own exposure and outlier rate.
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
        // All weights are relative to nominal: lowering them together keeps their ratios.
        let excess = (highest - LOG_ODDS_MAX).max(0.0);
        if excess > 0.0 {
            for component in self.components.iter_mut() {
                component.log_weight -= excess;
            }
            self.log_odds -= excess;
        }
    }
}

/// Effect of contamination on the `square` of a whitened residual, which is an outlier with the
/// probability `rate`. Returns the square with the same density under pure normal noise, and the
/// expected variance of the noise. An outlier has [`SPREAD`] times the deviation of the whole
/// residual: a bias that is not known yet widens it too, so that arbitrary values of a broken
/// channel stay evidence.
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
        // Shares of weights beyond all numbers are not defined.
        if !total.is_finite() {
            return *self;
        }
        let (one, two) = (
            (self.log_weight - total).exp(),
            (older.log_weight - total).exp(),
        );
        // One variance serves all dimensions: the mean over them.
        let distance = (self.bias - older.bias).norm_squared() / self.dimensions.max(1.0);
        // After absurd residuals the distance may overflow; then only the parts' variances count.
        let between = if one * two > 0.0 && distance.is_finite() {
            one * two * distance
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
            "a single residual is evidence against it: {against}"
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
                let error = filter.log_odds() - every_onset(&residuals, 1.0, 1e-3);
                let allowed = if step < 2 { 1e-12 } else { 0.7 };
                assert!(error.abs() < allowed, "{lambda}, step {step}: {error}");
            }
        }
    }

    #[test]
    fn the_gain_is_the_likelihood_ratio_without_the_birth() {
        let mut filter = Ages::<1>::new(2.0);
        filter.step(&SVector::from([3.0]), 0.01);
        let ratio = crate::logspace::log_normal(3.0, 5.0) - crate::logspace::log_normal(3.0, 1.0);
        assert!((filter.gain() - ratio).abs() < 1e-12);
        let before = filter;
        filter.step(&SVector::from([f64::NAN]), 0.01);
        assert_eq!(filter, before);
    }

    #[test]
    fn an_outlier_of_both_states_is_hardly_evidence() {
        let gain = |outlier_rate| {
            let mut filter = Ages::<1>::new(2.0);
            let residual = WhitenedResidual {
                value: SVector::from([8.0]),
                exposure: 1.0,
                outlier_rate,
            };
            filter.take(&residual, 0.01);
            filter.gain()
        };
        // The mixture's densities by hand; an outlier has ten times the deviation.
        let density = |rate: f64, variance: f64| {
            let normal = |v: f64| crate::logspace::log_normal(8.0, v).exp();
            (1.0 - rate) * normal(variance) + rate * normal(100.0 * variance)
        };
        for rate in [1e-6, 0.01, 0.2] {
            let expected = (density(rate, 5.0) / density(rate, 1.0)).ln();
            assert!((gain(rate) - expected).abs() < 1e-9, "{rate}");
        }
        assert!(gain(0.0) > 20.0 && gain(0.2) < 2.0);
    }

    #[test]
    fn a_residual_is_whitened_by_all_its_variance_and_exposed_by_the_usual_part() {
        let residual = WhitenedResidual::<1>::new(6.0, 4.0, 3.0, 0.1);
        assert_eq!(residual.value[0], 3.0);
        assert_eq!((residual.exposure, residual.outlier_rate), (0.5, 0.1));
        assert_eq!(WhitenedResidual::<1>::new(6.0, 4.0, 5.0, 0.1).exposure, 0.0);
    }

    #[test]
    fn merged_components_keep_weight_and_moments() {
        let part = |p: f64, bias, variance| Component::<2> {
            log_weight: p.ln(),
            bias: SVector::from(bias),
            variance,
            dimensions: 2.0,
        };
        let merged = part(1.0, [1.0, 0.0], 2.0).merged(&part(3.0, [3.0, 4.0], 6.0));
        assert!((merged.log_weight - 4.0_f64.ln()).abs() < 1e-12);
        assert!((merged.bias - SVector::from([2.5, 3.0])).abs().max() < 1e-12);
        // .25 of 2 and .75 of 6, and .25 x .75 of the squared distance 20, over two dimensions.
        assert!((merged.variance - (0.5 + 4.5 + 0.1875 * 10.0)).abs() < 1e-12);
        let impossible = part(0.0, [9.0, 9.0], 1.0);
        assert_eq!(impossible.merged(&impossible), impossible);
    }

    #[test]
    fn log_odds_end_at_their_bound_with_the_ratios_kept() {
        let mut filter = Ages::<1>::new(2.0);
        for _ in 0..3 {
            filter.step(&SVector::from([60.0]), 1e-3);
        }
        let weights = filter.components.iter().map(|it| it.log_weight);
        let highest = weights.fold(f64::NEG_INFINITY, f64::max);
        assert!((highest - LOG_ODDS_MAX).abs() < 1e-9, "{highest}");
        assert_eq!(filter.log_odds(), LOG_ODDS_MAX);
        let sum = filter.components.iter().map(|it| it.log_weight);
        assert!((filter.log_odds - log_sum_exp(&sum.collect::<Vec<_>>())).abs() < 1e-9);
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
