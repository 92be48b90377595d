//! What labelled runs showed of a change that is no fault, and whether the last seconds show one.
//!
//! A change so many blocks ago leaves a step: the mean of the newest blocks less that of those
//! before. Without a change it is of a law of covariance `S`. Over another ground one wheel is held
//! and then another, and how much differs from crossing to crossing: with a change the mean is 0
//! still, and the covariance larger, `S + D`. In the directions `w` of the largest ratios `λ` of
//! the two, `wᵀSw = 1`, the step is of unit variance without, and `λ` with a change. A single large
//! step is to say little of the law, so that both are Student's.

use serde::{Deserialize, Serialize};
use vigil_checkpoint::{Checkpoint, CheckpointValue};
use vigil_inference::logspace::log_sum_exp;

use super::CHANNELS_MAX;
use super::component::{Quantity, targets};
use super::law::BLOCKS;
use super::window::Window;
use crate::context_table::CONTEXTS_MAX;
use crate::description::Description;

/// Ages of a change that are tried, in blocks: 1 to 4.
pub const AGES: usize = 4;
/// Fewest blocks before the newest ones: runs may be short.
const BEFORE_MIN: usize = 2;
/// Directions of an age at most.
pub const DIRECTIONS_MAX: usize = 4;
/// Degrees of freedom of both laws. Chosen.
const FREEDOM: f64 = 20.0;
/// Predicted velocity of a pose, in deviations, from which on it has a way.
const MOVES: f64 = 1.0;
/// Largest weight, ratio and threshold of a file.
const WEIGHT_MAX: f64 = 1e6;
const RATIO_MAX: f64 = 1e9;
/// Time after a change in which none is told, s: the window holds it still.
pub const WAIT_S: f64 = 4.0;

/// One step of all channels.
pub type Step = [f64; CHANNELS_MAX];
/// The steps of all ages; none where the record is too short.
pub type Steps = [Option<Step>; AGES];

/// What of a window is looked at.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct StepChannels {
    /// Its channels.
    pub channels: usize,
    /// True if the first two are the velocity of a pose, forward and to the left.
    pub has_pose: bool,
}

impl StepChannels {
    /// All channels of a robot.
    #[must_use]
    pub fn of_robot(robot: &Description) -> Self {
        let all = targets(robot);
        let of = |i: usize| all.get(i).map(|target| target.quantity);
        Self {
            channels: all.len(),
            has_pose: (of(0), of(1)) == (Some(Quantity::Forward), Some(Quantity::Lateral)),
        }
    }
}

/// The steps that channels show, each over the deviation that it has if blocks are independent and
/// of unit variance. A channel that is missing on one side shows none. The velocity of a pose is
/// taken along and across the way that it was to go in the newest blocks.
#[must_use]
pub fn steps(window: &Window, seen: StepChannels) -> Steps {
    let whole = window.whole_blocks().min(BLOCKS);
    std::array::from_fn(|age| {
        let newest = age + 1;
        let before = whole
            .checked_sub(newest)
            .filter(|&count| count >= BEFORE_MIN)?;
        let mut step = [0.0; CHANNELS_MAX];
        for (step, row) in step.iter_mut().zip(&window.z).take(seen.channels) {
            let (older, newer) = row[BLOCKS - whole..].split_at(before);
            if let (Some((older, before)), Some((newer, newest))) = (mean(older), mean(newer)) {
                *step = (newer - older) / (1.0 / newest + 1.0 / before).sqrt();
            }
        }
        if seen.has_pose {
            let [forward, left] = [0, 1].map(|channel: usize| {
                let row = &window.predicted[channel][BLOCKS - newest..];
                row.iter().sum::<f64>() / newest as f64
            });
            (step[0], step[1]) = along_and_across(Velocity { forward, left }, step[0], step[1]);
        }
        Some(step)
    })
}

/// A velocity over its deviations.
struct Velocity {
    forward: f64,
    left: f64,
}

/// A step forward and to the left, along and across the way of a robot; of one that hardly moves
/// as it is.
fn along_and_across(way: Velocity, forward: f64, left: f64) -> (f64, f64) {
    let speed = way.forward.hypot(way.left);
    if speed < MOVES {
        return (forward, left);
    }
    let (cos, sin) = (way.forward / speed, way.left / speed);
    (cos * forward + sin * left, cos * left - sin * forward)
}

/// Mean of the blocks that are known, and their number.
fn mean(values: &[Option<f64>]) -> Option<(f64, f64)> {
    let known = values.iter().flatten();
    let (sum, count) = known.fold((0.0, 0.0), |(sum, count), z| (sum + z, count + 1.0));
    (count > 0.0).then(|| (sum / count, count))
}

/// A direction in which steps are larger with a change.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct StepDirection {
    /// Weight of each channel.
    pub weights: Vec<f64>,
    /// Variance along it with a change, over that without.
    pub ratio: f64,
}

/// How a change of one age shows.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ChangeAge {
    /// The directions; none: it does not show.
    #[serde(default)]
    pub direction: Vec<StepDirection>,
}

impl ChangeAge {
    /// Log-likelihood ratio of a change of this age to none.
    #[must_use]
    pub fn log_ratio(&self, step: &Step) -> f64 {
        let (mut without, mut with, mut spread) = (0.0, 0.0, 0.0);
        for direction in &self.direction {
            let parts = direction.weights.iter().zip(step);
            let along: f64 = parts.map(|(weight, value)| weight * value).sum();
            without += along * along;
            with += along * along / direction.ratio;
            spread += direction.ratio.ln();
        }
        let of = |square: f64| (square / FREEDOM).ln_1p();
        let size = self.direction.len() as f64;
        0.5 * (FREEDOM + size) * (of(without) - of(with)) - 0.5 * spread
    }
}

/// How a change shows.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ContextChange {
    /// Name of the declared context.
    pub context: String,
    /// Runs that it was learned from.
    pub runs: usize,
    /// Log-likelihood ratio beyond which it is told, nats.
    pub threshold: f64,
    /// By its age.
    pub age: Vec<ChangeAge>,
}

impl ContextChange {
    /// Log-likelihood ratio of a change to none, over all ages alike, and the most probable age,
    /// in blocks. None if no age is seen yet.
    #[must_use]
    pub fn log_ratio(&self, steps: &Steps) -> Option<(f64, usize)> {
        let mut ratios = [f64::NEG_INFINITY; AGES];
        let mut best = None;
        for (i, (age, step)) in self.age.iter().zip(steps).enumerate() {
            let Some(step) = step else { continue };
            ratios[i] = age.log_ratio(step);
            if best.is_none_or(|best: usize| ratios[i] > ratios[best]) {
                best = Some(i);
            }
        }
        let best = best?;
        Some((log_sum_exp(&ratios) - (AGES as f64).ln(), best + 1))
    }
}

/// How all changes show.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ContextChanges {
    /// The contexts of which labelled runs show enough.
    pub change: Vec<ContextChange>,
}

impl ContextChanges {
    /// True if none is learned.
    #[must_use]
    pub const fn is_empty(&self) -> bool {
        self.change.is_empty()
    }

    /// True if they are of this many channels.
    #[must_use]
    pub fn fits(&self, channels: usize) -> bool {
        let is_direction = |one: &StepDirection| {
            one.weights.len() == channels
                && one.weights.iter().all(|weight| weight.abs() <= WEIGHT_MAX)
                && (1.0..=RATIO_MAX).contains(&one.ratio)
        };
        let is_age = |age: &ChangeAge| {
            age.direction.len() <= DIRECTIONS_MAX && age.direction.iter().all(is_direction)
        };
        let is_whole = |one: &ContextChange| {
            one.age.len() == AGES
                && one.age.iter().all(is_age)
                && (0.0..=RATIO_MAX).contains(&one.threshold)
        };
        self.change.len() <= CONTEXTS_MAX && self.change.iter().all(is_whole)
    }
}

/// A change that was told.
#[derive(Debug, Clone, Copy, PartialEq, Eq, CheckpointValue)]
pub struct ToldChange {
    /// Place of the context in the robot's description.
    pub context: usize,
    /// When it came, capture time, ns.
    pub t_ns: u64,
}

/// Tells changes in windows that follow each other.
#[derive(Debug, Clone, Checkpoint)]
pub struct ChangeWatch {
    /// With their places in the description.
    #[checkpoint(fixed)]
    watched: Vec<(usize, ContextChange)>,
    #[checkpoint(fixed)]
    seen: StepChannels,
    /// Time for which none is told yet, s.
    wait_s: f64,
    count: u32,
    last: Option<ToldChange>,
}

impl ChangeWatch {
    /// A watch of the changes of `declared` contexts that were learned.
    #[must_use]
    pub fn new(robot: &Description, learned: Option<&ContextChanges>) -> Self {
        let declared = &robot.context;
        let place = |one: &ContextChange| declared.iter().position(|it| it.name == one.context);
        let watched = learned.into_iter().flat_map(|learned| &learned.change);
        let watched = watched.filter_map(|one| Some((place(one)?, one.clone())));
        Self {
            watched: watched.collect(),
            seen: StepChannels::of_robot(robot),
            wait_s: 0.0,
            count: 0,
            last: None,
        }
    }

    /// Begins a new record: what was told stays told.
    pub const fn clear(&mut self) {
        self.wait_s = 0.0;
    }

    /// Takes a window that ends at `t_ns` and is `dt_s` newer than the last one. True if it shows a
    /// change that was not told yet.
    pub fn take(&mut self, window: &Window, t_ns: u64, dt_s: f64) -> bool {
        if self.watched.is_empty() {
            return false;
        }
        self.wait_s = (self.wait_s - dt_s).max(0.0);
        if self.wait_s > 0.0 {
            return false;
        }
        let steps = steps(window, self.seen);
        let beyond = |(place, change): &(usize, ContextChange)| {
            let (log_ratio, age) = change.log_ratio(&steps)?;
            Some((log_ratio - change.threshold, *place, age))
        };
        let found = self.watched.iter().filter_map(beyond);
        let Some((beyond, context, age)) = found.max_by(|a, b| a.0.total_cmp(&b.0)) else {
            return false;
        };
        if beyond.is_nan() || beyond <= 0.0 {
            return false;
        }
        let age_ns = (age as f64 * window.block_s() * 1e9) as u64;
        self.wait_s = WAIT_S;
        self.count = self.count.wrapping_add(1);
        self.last = Some(ToldChange {
            context,
            t_ns: t_ns.saturating_sub(age_ns),
        });
        true
    }

    /// Changes told so far.
    #[must_use]
    pub const fn count(&self) -> u32 {
        self.count
    }

    /// The last of them.
    #[must_use]
    pub const fn last(&self) -> Option<ToldChange> {
        self.last
    }
}

#[cfg(test)]
mod tests;
