//! Detection on a planar pose: nominal motion against nominal motion plus an unknown departure.
//!
//! Under the fault the robot departs from its nominal model, from an onset on, by an unknown
//! constant amount per metre. Each onset (a bounded number of them, [`crate::onsets`]) has a
//! [`Track`] that learns that amount, forked from the nominal one. The measurements pull the
//! nominal track along, so that the residuals of such a fault are not constant: they grow and
//! settle. A track per onset predicts them exactly, and detects a fault sooner than a constant bias
//! of the residual does.
//!
//! A healthy robot departs from its model too: slip, slope, the offset of a servo. The nominal
//! track learns that as its context, up to a bound ([`MotionNoise::bound`]), so that a larger
//! lasting departure is never learned away. A fault of an unknown kind is weighted by the
//! probability that its departure lies beyond the same bound: Bayes' rule for a prior truncated
//! there. The ground may also change suddenly, which makes the learned context useless: each such
//! change is a healthy hypothesis of its own. Its departure is held within the nominal bound too.

use nalgebra::{Matrix3, Vector3};
use vigil_checkpoint::{Checkpoint, CheckpointValue};

use crate::angle::wrap;
use crate::gaussian::log_density;
use crate::logspace::log_add;
use crate::onsets::{Onset, Onsets};
use crate::outlier::Trust;
use crate::track::{Context, Displacement, MotionNoise, Track};

/// Largest log-odds. Chosen by hand: more evidence changes no decision, and each nat must be lost
/// again when the fault ends; with less, alarms with a very long false-alarm interval are
/// impossible.
pub const LOG_ODDS_MAX: f64 = 40.0;
/// Components less probable than this, by their log-odds, are dropped. 1e-13 has no weight beside
/// births of 1e-5 per observation; a higher bound would drop births.
const LOG_ODDS_MIN: f64 = -30.0;
/// A change of the ground is dropped once it has lost this much log-weight since it entered, nats.
/// Chosen by hand: at a factor of 150 the next change enters with much more weight; less drops true
/// changes after one outlier, more costs time.
const CHANGE_LOSES: f64 = 5.0;
/// Log-odds against no change at which a change of the ground is adopted, nats. Chosen by hand: a
/// wrong adoption only discards what was learned of the ground; a higher threshold delays it.
const CHANGED: f64 = 2.0;

/// A fault, its end, or a change of the ground that began at one of some successive steps.
#[derive(Debug, Clone, Copy, PartialEq, CheckpointValue)]
struct Hypothesis {
    log_weight: f64,
    /// Part of the log-weight: the log-probability that its departure is material.
    log_material: f64,
    track: Track,
}

/// The motion under faults of one kind.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Kind {
    /// Share of all faults.
    pub share: f64,
    /// Displacement at the mean departure.
    pub step: Displacement,
    /// How far faults of this kind depart from the mean.
    pub noise: MotionNoise,
    /// True if a departure counts as a fault only beyond the nominal bound.
    pub is_unknown: bool,
}

/// The filter, over K kinds of faults.
#[derive(Debug, Clone, PartialEq, Checkpoint)]
pub struct Departure<const K: usize> {
    #[checkpoint(fixed)]
    nominal: MotionNoise,
    track: Track,
    /// Context of the nominal mode; while a fault is suspected, that from before.
    context: Context,
    trust: Trust,
    is_unknown: [bool; K],
    faults: [Onsets<Hypothesis>; K],
    /// While a fault is suspected: nominal motion again since one of some successive steps.
    ended: Onsets<Hypothesis>,
    /// Nominal motion on another ground since one of some successive steps.
    changed: Onsets<Hypothesis>,
    /// Log-weight of the last change when it entered.
    log_change: f64,
    is_suspected: bool,
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

/// Evidence of a measured pose.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PoseEvidence {
    /// Log-density of the pose under nominal motion.
    pub log_density: f64,
    /// Its residual in the body frame (forward, left, yaw), whitened.
    pub residual: Vector3<f64>,
}

impl<const K: usize> Departure<K> {
    /// A filter at the origin. `nominal`: departures per metre of a healthy robot.
    #[must_use]
    pub fn new(nominal: MotionNoise) -> Self {
        Self {
            track: Track::new(Vector3::zeros(), Matrix3::identity(), &nominal),
            context: Context::default(),
            trust: Trust::default(),
            is_unknown: [false; K],
            faults: [Onsets::default(); K],
            ended: Onsets::default(),
            changed: Onsets::default(),
            log_change: 0.0,
            is_suspected: false,
            nominal,
            gain: 0.0,
        }
    }

    /// Starts from a pose (x, y, yaw) known with these variances, without a fault.
    pub fn start(&mut self, pose: [f64; 3], variance: [f64; 3]) {
        let covariance = Matrix3::from_diagonal(&Vector3::from(variance));
        self.clear();
        self.trust = Trust::default();
        self.track = Track::new(Vector3::from(pose), covariance, &self.nominal);
    }

    /// Forgets all evidence for a fault. The most probable healthy track stays: that of an end, if
    /// a fault was suspected.
    pub fn forget(&mut self) {
        // Log-weights are relative to the nominal track: above 0 a change is more probable.
        let changed = best(&self.changed).filter(|changed| changed.log_weight > 0.0);
        let healthy = [best(&self.ended), changed].into_iter().flatten();
        let likeliest = healthy.max_by(|a, b| a.log_weight.total_cmp(&b.log_weight));
        if let Some(track) = likeliest.map(|healthy| healthy.track) {
            self.track = track;
        }
        self.clear();
    }

    fn clear(&mut self) {
        self.faults = [Onsets::default(); K];
        self.ended = Onsets::default();
        self.changed = Onsets::default();
    }

    /// Puts every track at this pose and keeps the deviations: the frame in which the pose is
    /// measured has jumped, or the pose was lost.
    pub fn anchor(&mut self, pose: [f64; 3], variance: [f64; 3]) {
        self.trust = Trust::default();
        self.track.anchor(pose, variance);
        for fault in self.all_mut() {
            fault.track.anchor(pose, variance);
        }
        for healthy in self.ended.iter_mut().chain(self.changed.iter_mut()) {
            healthy.track.anchor(pose, variance);
        }
    }

    /// The nominal track.
    #[must_use]
    pub const fn track(&self) -> &Track {
        &self.track
    }

    /// The context of the nominal mode; while a fault is suspected, that from before.
    #[must_use]
    pub const fn context(&self) -> &Context {
        &self.context
    }

    /// Natural log-odds of a fault.
    #[must_use]
    pub fn log_odds(&self) -> f64 {
        let log_odds = self.log_faults() - self.log_healthy();
        assert!(
            !log_odds.is_nan(),
            "the log-odds of a departure are a number"
        );
        log_odds
    }

    /// Log-weight of all faults, relative to the nominal track.
    fn log_faults(&self) -> f64 {
        total(self.faults.iter().flat_map(Onsets::iter))
    }

    /// Log-weight of nominal motion on any ground, relative to the nominal track.
    fn log_healthy(&self) -> f64 {
        log_add(0.0, total(self.changed.iter()))
    }

    /// Log-odds of a fault that is present against one that has ended, or that never was.
    fn log_persists(&self) -> f64 {
        self.log_faults() - total(self.ended.iter()).max(self.log_healthy())
    }

    /// Log-likelihood ratio of the last pose for a fault that was present and stays, to one that
    /// has ended or never was; 0 where the pose is no evidence.
    #[must_use]
    pub const fn gain(&self) -> f64 {
        self.gain
    }

    fn all_mut(&mut self) -> impl Iterator<Item = &mut Hypothesis> {
        self.faults.iter_mut().flat_map(Onsets::iter_mut)
    }

    /// Moves by one displacement, each fault by that of its kind. A fault begins before it with the
    /// probability `birth`, 0 for none. While a fault is `suspected` it may end, wherever it has
    /// led the robot. The nominal track then learns nothing of the motion: the effects of a fault
    /// are no context of the nominal mode.
    pub fn predict(
        &mut self,
        step: &Displacement,
        kinds: &[Kind; K],
        birth: f64,
        suspected: Option<Suspicion>,
    ) {
        self.is_suspected = suspected.is_some();
        match suspected {
            None => self.context = self.track.context(),
            Some(_) => self.context.fade(step.travel_m, &self.nominal),
        }
        self.is_unknown = kinds.each_ref().map(|kind| kind.is_unknown);
        for (faults, kind) in self.faults.iter_mut().zip(kinds) {
            let born = birth * kind.share;
            if born > 0.0 && born.is_finite() {
                faults.enter(Hypothesis {
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
        self.predict_change(step, birth > 0.0);
        self.track.predict(step, &self.nominal);
    }

    /// While a fault is suspected no change of the ground begins: it could not be distinguished
    /// from an end. Where no fault may begin either, nothing does.
    fn predict_change(&mut self, step: &Displacement, may_begin: bool) {
        let nominal = self.nominal;
        let p = -(-nominal.changes_1_m * step.travel_m.abs()).exp_m1();
        if may_begin && p > 0.0 && !self.is_suspected {
            self.log_change = p.ln();
            self.changed.enter(Hypothesis {
                log_weight: p.ln(),
                log_material: 0.0,
                track: self.track.renewed(&nominal),
            });
        }
        for changed in self.changed.iter_mut() {
            changed.track.predict(step, &nominal);
        }
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
        let likeliest = likeliest.filter(|_| ends > 0.0 && ends.is_finite());
        if let Some(track) = likeliest.map(|fault| fault.track.enter(&context, &nominal)) {
            self.ended.enter(Hypothesis {
                log_weight: self.log_faults() + ends.ln(),
                log_material: 0.0,
                track,
            });
        }
        for ended in self.ended.iter_mut() {
            ended.track.predict(step, &nominal);
        }
    }

    /// Variances of a measured pose, widened where it is probably an outlier. `rates`: share of
    /// outliers, axis by axis. See [`Trust::variance`].
    pub fn trusted(&mut self, pose: [f64; 3], variance: [f64; 3], rates: [f64; 3]) -> [f64; 3] {
        let faults = self.faults.iter().flat_map(Onsets::iter);
        let healthy = self.ended.iter().chain(self.changed.iter());
        let others = faults.chain(healthy).map(|it| (&it.track, it.log_weight));
        let all = others.chain([(&self.track, 0.0)]);
        self.trust.variance(all, pose, variance, rates)
    }

    /// Conditions on a measured pose (x, y, yaw) with independent noise of `variance`. It moves the
    /// weights only if it `counts`. None, and nothing changed, if the nominal track cannot take it.
    pub fn update(
        &mut self,
        pose: [f64; 3],
        variance: [f64; 3],
        counts: bool,
    ) -> Option<PoseEvidence> {
        self.gain = 0.0;
        let evidence = self.residual(pose, variance)?;
        self.track.update(pose, variance)?;
        let before = self.log_persists();
        let take = |hypothesis: &mut Hypothesis| {
            let gained = hypothesis.track.update(pose, variance);
            // A hypothesis that cannot take it is impossible, even where it is no evidence.
            let gained = gained.map_or(f64::NEG_INFINITY, |gained| gained - evidence.log_density);
            if counts || gained == f64::NEG_INFINITY {
                hypothesis.log_weight += gained;
            }
        };
        self.all_mut().for_each(take);
        self.ended.iter_mut().for_each(take);
        self.changed.iter_mut().for_each(take);
        self.cut_off();
        let gain = self.log_persists() - before;
        self.gain = if gain.is_finite() { gain } else { 0.0 };
        self.follow_ground();
        self.bound();
        Some(evidence)
    }

    /// Holds the nominal mode within its bound, and an unknown fault beyond it.
    fn cut_off(&mut self) {
        let bound = self.nominal.bound;
        self.track.saturate(&bound);
        for healthy in self.ended.iter_mut().chain(self.changed.iter_mut()) {
            healthy.track.saturate(&bound);
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

    /// Adopts a change of the ground once it is much more probable than none: its track becomes the
    /// nominal one, and all weights become relative to it.
    fn follow_ground(&mut self) {
        if self.is_suspected {
            return;
        }
        let Some(Hypothesis {
            log_weight, track, ..
        }) = best(&self.changed).copied()
        else {
            return;
        };
        if log_weight < CHANGED {
            return;
        }
        self.track = track;
        for hypothesis in self.faults.iter_mut().flat_map(Onsets::iter_mut) {
            hypothesis.log_weight -= log_weight;
        }
        self.changed = Onsets::default();
    }

    /// Bounds the weights of faults, and drops improbable hypotheses.
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
        for healthy in self.ended.iter_mut().chain(self.changed.iter_mut()) {
            healthy.log_weight -= excess;
        }
        let least = self.log_healthy() + self.log_change - CHANGE_LOSES;
        self.changed.retain(|changed| changed.log_weight > least);
        let likeliest = best(&self.ended).map_or(0.0, |ended| ended.log_weight);
        self.ended
            .retain(|ended| ended.log_weight > likeliest + LOG_ODDS_MIN);
    }

    /// Evidence of a pose under nominal motion.
    fn residual(&self, pose: [f64; 3], variance: [f64; 3]) -> Option<PoseEvidence> {
        let (innovation, spread) = self.track.innovation(pose, variance);
        let (sin, cos) = wrap(self.track.pose()[2]).sin_cos();
        let turn = Matrix3::new(cos, sin, 0.0, -sin, cos, 0.0, 0.0, 0.0, 1.0);
        let innovation = turn * innovation;
        let (log_density, factor) = log_density(&innovation, turn * spread * turn.transpose())?;
        let residual = factor.l_dirty().solve_lower_triangular(&innovation)?;
        Some(PoseEvidence {
            log_density,
            residual,
        })
    }
}

/// The most probable of some hypotheses.
fn best(all: &Onsets<Hypothesis>) -> Option<&Hypothesis> {
    all.iter()
        .max_by(|a, b| a.log_weight.total_cmp(&b.log_weight))
}

/// Logarithm of the sum of the weights of some hypotheses.
fn total<'a>(all: impl Iterator<Item = &'a Hypothesis>) -> f64 {
    all.map(|fault| fault.log_weight)
        .fold(f64::NEG_INFINITY, log_add)
}

impl Onset for Hypothesis {
    /// Keeps the weight and the first two moments of both.
    fn merged(&self, older: &Self) -> Self {
        let log_weight = log_add(self.log_weight, older.log_weight);
        // Shares of weights beyond all numbers are not defined.
        if !log_weight.is_finite() {
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
mod tests;
