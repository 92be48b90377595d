//! Detection on a planar pose: nominal motion against nominal motion plus an unknown departure.
//!
//! Under the fault the robot moves, from an onset on, by an unknown constant amount per metre more
//! than its nominal model says. Each onset (a bounded number of them, [`crate::onsets`]) has a
//! [`Track`] that learns that amount, forked from the nominal one. As the nominal track is pulled
//! along by the measurements, the residuals of such a fault are no constant, but grow and settle;
//! here they are what they should be for every fault, and a fault is seen sooner than by a constant
//! bias of the residual.
//!
//! A healthy robot departs from its model too: slip, slope, a servo that stands off. The nominal
//! track learns that as its context, up to a bound ([`MotionNoise::bound`]): what departs by more
//! for good is never learned away. A fault of an unknown kind counts as far as its departure lies
//! beyond the same bound, with the probability that it does: that is Bayes for a departure whose
//! prior is cut off there.

use nalgebra::{Matrix3, Vector3};

use crate::angle::wrap;
use crate::logspace::log_add;
use crate::onsets::{Onset, Onsets};
use crate::outlier::Trust;
use crate::track::{Context, Displacement, MotionNoise, Track};

/// Log-odds beyond which more evidence changes nothing, but delays recovery.
pub const LOG_ODDS_MAX: f64 = 40.0;
/// Components less probable than this, by their log-odds, are dropped.
const LOG_ODDS_MIN: f64 = -30.0;

/// A fault that began at one of some successive steps.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Fault {
    log_weight: f64,
    /// Part of the weight: that its departure is material.
    log_material: f64,
    track: Track,
}

/// What faults of one kind do to the motion.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Kind {
    /// Share of all faults.
    pub share: f64,
    /// Displacement at the mean departure.
    pub step: Displacement,
    /// How far faults of this kind depart from that.
    pub noise: MotionNoise,
    /// Whether such a fault is one only where it departs beyond the nominal bound.
    pub is_unknown: bool,
}

/// The filter, over K kinds of faults.
#[derive(Debug, Clone, PartialEq)]
pub struct Departure<const K: usize> {
    nominal: MotionNoise,
    track: Track,
    /// Of the nominal mode, from before a fault was suspected.
    context: Context,
    trust: Trust,
    is_unknown: [bool; K],
    faults: [Onsets<Fault>; K],
    /// While a fault is suspected: nominal motion again, since one of some successive steps.
    ended: Onsets<Fault>,
    gain: f64,
}

/// How a suspected fault may end.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Suspicion {
    /// Variances (x, y, yaw) by which the nominal track diffuses in a step, so that it is not lost.
    pub variance: [f64; 3],
    /// Probability that the fault ends in a step.
    pub ends: f64,
}

/// What a pose said.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Said {
    /// Log-density of the pose under nominal motion.
    pub log_density: f64,
    /// Its residual in the body frame (forward, left, yaw), whitened.
    pub residual: Vector3<f64>,
}

impl<const K: usize> Departure<K> {
    /// A filter at the origin, whose motion per metre departs from its model as `nominal` says in
    /// health.
    #[must_use]
    pub fn new(nominal: MotionNoise) -> Self {
        Self {
            track: Track::new(Vector3::zeros(), Matrix3::identity(), &nominal),
            context: Context::default(),
            trust: Trust::default(),
            is_unknown: [false; K],
            faults: [Onsets::default(); K],
            ended: Onsets::default(),
            nominal,
            gain: 0.0,
        }
    }

    /// Starts from a pose (x, y, yaw) known with these variances, without a fault.
    pub fn start(&mut self, pose: [f64; 3], variance: [f64; 3]) {
        let covariance = Matrix3::from_diagonal(&Vector3::from(variance));
        self.track = Track::new(Vector3::from(pose), covariance, &self.nominal);
        self.forget();
    }

    /// Forgets what speaks for a fault, and keeps the track: that of the most probable end, if a
    /// fault was suspected.
    pub fn forget(&mut self) {
        if let Some(track) = best(&self.ended).map(|ended| ended.track) {
            self.track = track;
        }
        self.faults = [Onsets::default(); K];
        self.ended = Onsets::default();
    }

    /// Puts every track at this pose and keeps what is known of the motion: the frame of the
    /// measurement has jumped, or the pose was lost.
    pub fn anchor(&mut self, pose: [f64; 3], variance: [f64; 3]) {
        self.track.anchor(pose, variance);
        for fault in self.all_mut() {
            fault.track.anchor(pose, variance);
        }
        for ended in self.ended.iter_mut() {
            ended.track.anchor(pose, variance);
        }
    }

    /// The nominal track.
    #[must_use]
    pub const fn track(&self) -> &Track {
        &self.track
    }

    /// What is known of the nominal mode's deviations; while a fault is suspected, from before it.
    #[must_use]
    pub const fn context(&self) -> &Context {
        &self.context
    }

    /// Natural log-odds of a fault.
    #[must_use]
    pub fn log_odds(&self) -> f64 {
        total(self.faults.iter().flat_map(Onsets::iter))
    }

    /// What the last pose said for a fault that was there, and is: the logarithm of the
    /// likelihoods' ratio to one that has ended, or to none that began; 0 where it is no evidence.
    #[must_use]
    pub const fn gain(&self) -> f64 {
        self.gain
    }

    fn all_mut(&mut self) -> impl Iterator<Item = &mut Fault> {
        self.faults.iter_mut().flat_map(Onsets::iter_mut)
    }

    /// Moves by one displacement, each fault by that of its kind. A fault begins before it with the
    /// probability `birth`, 0 for none. While a fault is `suspected` it may end, wherever it has
    /// led the robot, and the nominal track learns nothing of the motion: what a fault does is no
    /// context of the nominal mode.
    pub fn predict(
        &mut self,
        step: &Displacement,
        kinds: &[Kind; K],
        birth: f64,
        suspected: Option<Suspicion>,
    ) {
        match suspected {
            None => self.context = self.track.context(),
            Some(_) => self.context.fade(step.travel_m, &self.nominal),
        }
        self.is_unknown = kinds.each_ref().map(|kind| kind.is_unknown);
        for (faults, kind) in self.faults.iter_mut().zip(kinds) {
            let born = birth * kind.share;
            if born > 0.0 {
                faults.enter(Fault {
                    log_weight: born.ln(),
                    log_material: 0.0,
                    track: self.track.enter(&self.context, &kind.noise),
                });
            }
            for fault in faults.iter_mut() {
                fault.track.predict(&kind.step, &kind.noise);
            }
        }
        self.predict_end(step, suspected);
        self.track.predict(step, &self.nominal);
    }

    fn predict_end(&mut self, step: &Displacement, suspected: Option<Suspicion>) {
        let Some(Suspicion { variance, ends }) = suspected else {
            self.ended = Onsets::default();
            return;
        };
        let (context, nominal) = (self.context, self.nominal);
        self.track = self.track.enter(&context, &nominal);
        self.track.diffuse(variance);
        let faults = self.faults.iter().filter_map(best);
        let likeliest = faults.max_by(|a, b| a.log_weight.total_cmp(&b.log_weight));
        let likeliest = likeliest.filter(|_| ends > 0.0);
        if let Some(track) = likeliest.map(|fault| fault.track.enter(&context, &nominal)) {
            self.ended.enter(Fault {
                log_weight: self.log_odds() + ends.ln(),
                log_material: 0.0,
                track,
            });
        }
        for ended in self.ended.iter_mut() {
            ended.track.predict(step, &nominal);
        }
    }

    /// Variances of a measured pose as far as it can be trusted where such shares of the samples
    /// are outliers.
    pub fn trusted(&mut self, pose: [f64; 3], variance: [f64; 3], rates: [f64; 3]) -> [f64; 3] {
        let faults = self.faults.iter().flat_map(Onsets::iter);
        let others = faults.chain(self.ended.iter()).map(|fault| &fault.track);
        let all = others.chain([&self.track]);
        self.trust.variance(all, pose, variance, rates)
    }

    /// Conditions on a measured pose (x, y, yaw) with independent noise of `variance`; it is
    /// evidence if `counts`. None, unchanged, if the nominal track cannot take it.
    pub fn update(&mut self, pose: [f64; 3], variance: [f64; 3], counts: bool) -> Option<Said> {
        self.gain = 0.0;
        let said = self.residual(pose, variance)?;
        self.track.update(pose, variance)?;
        let before = self.log_odds() - total(self.ended.iter()).max(0.0);
        let take = |hypothesis: &mut Fault| {
            let gained = hypothesis.track.update(pose, variance);
            // What cannot take it is impossible.
            let gained = gained.map_or(f64::NEG_INFINITY, |gained| gained - said.log_density);
            if counts || gained == f64::NEG_INFINITY {
                hypothesis.log_weight += gained;
            }
        };
        self.all_mut().for_each(take);
        self.ended.iter_mut().for_each(take);
        self.cut_off();
        let gain = self.log_odds() - total(self.ended.iter()).max(0.0) - before;
        self.gain = if gain.is_finite() { gain } else { 0.0 };
        self.bound();
        Some(said)
    }

    /// Holds the nominal mode within its bound, and an unknown fault beyond it.
    fn cut_off(&mut self) {
        let bound = self.nominal.bound;
        self.track.saturate(&bound);
        for ended in self.ended.iter_mut() {
            ended.track.saturate(&bound);
        }
        let unknown = self.faults.iter_mut().zip(self.is_unknown);
        for fault in unknown
            .filter(|(_, is)| *is)
            .flat_map(|(all, _)| all.iter_mut())
        {
            let log_material = fault.track.log_material(&bound);
            fault.log_weight += log_material - fault.log_material;
            fault.log_material = log_material;
        }
    }

    /// Keeps the weights within bounds.
    fn bound(&mut self) {
        let highest = self
            .faults
            .iter()
            .filter_map(best)
            .map(|fault| fault.log_weight);
        let excess = highest.fold(0.0, |most, w| f64::max(most, w - LOG_ODDS_MAX));
        for faults in &mut self.faults {
            for fault in faults.iter_mut() {
                fault.log_weight -= excess;
            }
            faults.retain(|fault| fault.log_weight > LOG_ODDS_MIN);
        }
        for ended in self.ended.iter_mut() {
            ended.log_weight -= excess;
        }
        let likeliest = best(&self.ended).map_or(0.0, |ended| ended.log_weight);
        self.ended
            .retain(|ended| ended.log_weight > likeliest + LOG_ODDS_MIN);
    }

    /// What a pose would say of the nominal motion.
    fn residual(&self, pose: [f64; 3], variance: [f64; 3]) -> Option<Said> {
        let (apart, spread) = self.track.innovation(pose, variance);
        let (sin, cos) = wrap(self.track.pose()[2]).sin_cos();
        let turn = Matrix3::new(cos, sin, 0.0, -sin, cos, 0.0, 0.0, 0.0, 1.0);
        let (apart, spread) = (turn * apart, turn * spread * turn.transpose());
        let (log_density, factor) = crate::gaussian::log_density(&apart, spread)?;
        let residual = factor.l_dirty().solve_lower_triangular(&apart)?;
        Some(Said {
            log_density,
            residual,
        })
    }
}

/// The most probable of some hypotheses.
fn best(all: &Onsets<Fault>) -> Option<&Fault> {
    all.iter()
        .max_by(|a, b| a.log_weight.total_cmp(&b.log_weight))
}

/// Logarithm of the sum of their weights.
fn total<'a>(all: impl Iterator<Item = &'a Fault>) -> f64 {
    all.map(|fault| fault.log_weight)
        .fold(f64::NEG_INFINITY, log_add)
}

impl Onset for Fault {
    /// Keeps the weight and the first two moments of both.
    fn merged(&self, older: &Self) -> Self {
        let log_weight = log_add(self.log_weight, older.log_weight);
        if log_weight == f64::NEG_INFINITY {
            return *self;
        }
        let share = (self.log_weight - log_weight).exp();
        Self {
            log_weight,
            log_material: self.log_material * share + older.log_material * (1.0 - share),
            track: self.track.mixed(&older.track, share),
        }
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use proptest::prelude::*;
    use rand::{RngExt, SeedableRng};
    use rand_distr::StandardNormal;
    use rand_pcg::Pcg64Mcg;

    const VARIANCE: [f64; 3] = [2.5e-5; 3];
    const BIRTH: f64 = 1e-4;
    const SUSPECTED: Suspicion = Suspicion {
        variance: [2.5e-7; 3],
        ends: 1e-3,
    };

    fn noise(offset: f64, deviation: f64) -> MotionNoise {
        MotionNoise {
            offset: Matrix3::identity() * offset * offset,
            deviation: Matrix3::identity() * deviation * deviation,
            length_m: 0.3,
            white: Vector3::repeat(1e-8),
            drift: Vector3::zeros(),
            bound: Vector3::repeat(f64::INFINITY),
        }
    }

    const STEP: Displacement = Displacement {
        per_metre: [0.5, 1.0, 0.0],
        travel_m: 0.01,
        extra: [0.0; 3],
    };

    fn kinds() -> [Kind; 2] {
        let anything = Kind {
            share: 0.6,
            step: STEP,
            noise: noise(0.25, 0.03),
            is_unknown: false,
        };
        let slower = Kind {
            share: 0.4,
            step: Displacement {
                per_metre: [0.5, 0.9, 0.0],
                ..STEP
            },
            noise: noise(0.05, 0.03),
            is_unknown: false,
        };
        [anything, slower]
    }

    /// Poses measured on a path that turns by `apart` rad/m more from step `onset` on.
    fn poses(apart: f64, onset: usize, steps: usize, seed: u64) -> Vec<[f64; 3]> {
        let mut rng = Pcg64Mcg::seed_from_u64(seed);
        let mut at = [0.0_f64; 3];
        let drive = |step: usize| {
            let turn = (0.5 + if step < onset { 0.0 } else { apart }) * 0.01;
            let middle = at[2] + 0.5 * turn;
            at = [
                at[0] + 0.01 * middle.cos(),
                at[1] + 0.01 * middle.sin(),
                at[2] + turn,
            ];
            std::array::from_fn(|i| at[i] + 0.005 * rng.sample::<f64, _>(StandardNormal))
        };
        (0..steps).map(drive).collect()
    }

    fn filter() -> Departure<2> {
        let mut filter = Departure::new(noise(0.001, 0.001));
        filter.start([0.0; 3], [1e-4; 3]);
        filter
    }

    /// The log-odds from one track per onset and kind, none merged.
    fn every_onset(poses: &[[f64; 3]]) -> f64 {
        let mut nominal = filter().track;
        let mut all: Vec<(usize, f64, Track)> = Vec::new();
        for pose in poses {
            for (kind, its) in kinds().iter().enumerate() {
                all.push((
                    kind,
                    (BIRTH * its.share).ln(),
                    nominal.enter(&nominal.context(), &its.noise),
                ));
            }
            nominal.predict(&STEP, &noise(0.001, 0.001));
            let healthy = nominal.update(*pose, VARIANCE).unwrap();
            for (kind, log_weight, track) in &mut all {
                track.predict(&kinds()[*kind].step, &kinds()[*kind].noise);
                *log_weight += track.update(*pose, VARIANCE).unwrap() - healthy;
            }
        }
        let log_weights = all.iter().map(|(_, log_weight, _)| *log_weight);
        log_weights.fold(f64::NEG_INFINITY, log_add)
    }

    #[test]
    fn sharing_components_between_onsets_costs_little_against_every_onset() {
        for (apart, onset, steps) in [(0.0, 0, 150), (0.2, 60, 68), (-0.1, 60, 71), (0.05, 20, 40)]
        {
            let poses = poses(apart, onset, steps, 7);
            let mut filter = filter();
            for pose in &poses {
                filter.predict(&STEP, &kinds(), BIRTH, None);
                filter.update(*pose, VARIANCE, true).unwrap();
            }
            let expected = every_onset(&poses);
            assert!(expected < LOG_ODDS_MAX - 5.0, "{apart}: {expected}");
            let found = filter.log_odds();
            assert!(
                (found - expected).abs() < 0.7,
                "{apart}: {found}, {expected}"
            );
        }
    }

    #[test]
    fn a_departure_is_seen_and_its_end_too() {
        let mut filter = filter();
        let (there, back) = (poses(0.2, 100, 300, 3), poses(0.0, 0, 300, 4));
        let mut seen = None;
        for (step, pose) in there.iter().enumerate() {
            let follow = seen.map(|_| SUSPECTED);
            filter.predict(&STEP, &kinds(), BIRTH, follow);
            filter.update(*pose, VARIANCE, true).unwrap();
            if seen.is_none() && filter.log_odds() > 3.0 {
                seen = Some(step);
            }
        }
        assert!((103..130).contains(&seen.unwrap()), "{seen:?}");
        filter.anchor(back[0], VARIANCE);
        for pose in &back[1..] {
            filter.predict(&STEP, &kinds(), BIRTH, Some(SUSPECTED));
            filter.update(*pose, VARIANCE, true).unwrap();
        }
        assert!(filter.log_odds() < -3.0, "{}", filter.log_odds());
    }

    #[test]
    fn what_does_not_count_is_no_evidence() {
        let mut filter = filter();
        for pose in poses(0.3, 0, 100, 5) {
            filter.predict(&STEP, &kinds(), 0.0, None);
            filter.update(pose, VARIANCE, false).unwrap();
        }
        assert_eq!(filter.log_odds(), f64::NEG_INFINITY);
    }

    proptest! {
        #[test]
        fn no_pose_breaks_the_filter(values in prop::collection::vec(any::<[f64; 3]>(), 1..40)) {
            let mut filter = filter();
            for pose in values {
                filter.predict(&STEP, &kinds(), BIRTH, None);
                filter.update(pose, VARIANCE, true);
                prop_assert!(!filter.log_odds().is_nan() && filter.log_odds() < 1e3);
                prop_assert!(filter.track().pose().iter().all(|value| value.is_finite()));
            }
        }
    }
}
