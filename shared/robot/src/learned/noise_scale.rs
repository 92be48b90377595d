//! How much noisier the sensors are than the learned ones.

use vigil_blocks::WHEELS;
use vigil_checkpoint::CheckpointValue;
use vigil_inference::angle::wrap;

use super::wheels::{rolling_rate, steering_angle};
use super::{Model, Observation, Reading};
use crate::description::Description;
use crate::slot::Slot;
use crate::suspects::Suspects;

/// Squares above this many times the believed variance say nothing about noise (a jump, a fault).
/// Three deviations.
const CLIP: f64 = 9.0;
/// Squares above this many times that of the noise go to an outlier, or come from it. Noise reaches
/// it once in 1,900 samples.
const FAR: f64 = 12.0;
/// What an impulse leaves in successive differences of the first and the second order, as shares of
/// the largest square: binomial coefficients. A step leaves one, or two that are equal.
const IMPULSE: [&[f64]; 2] = [&[1.0, 1.0], &[0.25, 1.0, 0.25]];
/// Bounds of the rate of outliers: what is believed of a sensor that never had one, of which no
/// single sample is a fault, and what is no sensor any more. Once in 1.4 h of 50 ms; one sample in
/// ten.
const OUTLIER_RATE_MIN: f64 = 1e-5;
const OUTLIER_RATE_MAX: f64 = 0.1;
/// Outliers that count as seen before any sample. One in 10,000 of [`ASKED`].
const EXPECTED: f64 = 0.002;
/// Mean of a squared standard normal clipped at [`CLIP`]: 0.995, and half a percent to the high
/// side, with which the shipped model was calibrated.
const CLIPPED_MEAN: f64 = 0.99;
/// Bounds of the ratio. Noise that does not grow with the rate reads 0.1 at ten times the reference
/// rate.
const RATIO_MIN: f64 = 0.1;
/// A channel five times as noisy as learned is no healthy one: what is beyond is evidence.
const RATIO_MAX: f64 = 25.0;
/// Samples that the learned scale of 1 counts for: healthy sensors differ by a factor of two and
/// more, which two degrees of freedom say.
const PRIOR: f64 = 4.0;
/// Samples that count as asked for outliers before any was. One second of 50 ms.
const ASKED: f64 = 20.0;
/// Twice the log-odds that residuals add up to where they decide: of a pose, a gyro or a current
/// many do, to what an alarm takes, 11 nats by the prior (once an hour, in 50 ms), some to choose
/// kind and onset, and as many again to be sure ..
const DEVIANCE: f64 = 50.0;
/// .. and each of a wheel decides by itself, as far as it is no outlier: chosen, 8 nats.
const DEVIANCE_ALONE: f64 = 16.0;
/// Suspected samples, faded, after which their noise is believed: 300 in a row, 15 s of 50 ms,
/// known within sqrt(3.9 / 472) = 9 %.
const SETTLED: f64 = 236.0;
/// Samples over which the estimate forgets. Half a minute of 50 ms: known within sqrt(3.9 / 600) =
/// 8 %.
const MEMORY: f64 = 600.0;
const FADING: f64 = 1.0 - 1.0 / MEMORY;
/// Ratio of two intervals up to which a second difference tells an outlier of its middle sample
/// from the noise as well as one of equal intervals does, nearly: chosen.
const EVEN: f64 = 1.25;

/// How much noisier each channel is than learned, as ratios of standard deviations. A channel has
/// a scale of its own: one that is noisy hides nothing on another.
#[derive(Debug, Clone, Copy, PartialEq, CheckpointValue)]
pub struct NoiseScales {
    /// The pose: x, y, yaw.
    pub pose: [f64; 3],
    /// The wheels' encoders.
    pub wheels: [f64; WHEELS],
    /// The steering angles.
    pub steer: [f64; WHEELS],
    /// How often a sample of each channel is an outlier.
    pub outliers: OutlierRates,
}

/// Share of the samples of each channel that are far off, one by one.
#[derive(Debug, Clone, Copy, PartialEq, CheckpointValue)]
pub struct OutlierRates {
    /// The pose: x, y, yaw.
    pub pose: [f64; 3],
    /// The wheels' encoders.
    pub wheels: [f64; WHEELS],
    /// The steering angles.
    pub steer: [f64; WHEELS],
}

impl Default for OutlierRates {
    fn default() -> Self {
        Self {
            pose: [OUTLIER_RATE_MIN; 3],
            wheels: [OUTLIER_RATE_MIN; WHEELS],
            steer: [OUTLIER_RATE_MIN; WHEELS],
        }
    }
}

impl Default for NoiseScales {
    fn default() -> Self {
        Self {
            pose: [1.0; 3],
            wheels: [1.0; WHEELS],
            steer: [1.0; WHEELS],
            outliers: OutlierRates::default(),
        }
    }
}

/// Running estimate of the ratio of measurement variance to the learned variance, from differences
/// that no slow motion and no persistent fault affects.
///
/// While the channel is suspected, more noise may be the fault, and would hide its return: it is
/// seen apart, and believed only once it has settled within what a healthy channel may have.
#[derive(Debug, Clone, Copy, PartialEq, CheckpointValue)]
pub struct NoiseScale {
    /// Of the healthy channel.
    healthy: NoiseTally,
    healthy_outliers: OutlierTally,
    /// While it was suspected; outliers since it last came to be so.
    doubted: NoiseTally,
    doubted_outliers: OutlierTally,
    is_suspected: bool,
    /// The last squares over that of the noise, newest last.
    squares: [f64; 3],
}

impl Default for NoiseScale {
    fn default() -> Self {
        Self {
            healthy: NoiseTally {
                sum: PRIOR,
                count: PRIOR,
            },
            healthy_outliers: OutlierTally {
                outliers: 0.0,
                asked: ASKED,
            },
            doubted: NoiseTally::default(),
            doubted_outliers: OutlierTally::default(),
            is_suspected: false,
            squares: [0.0; 3],
        }
    }
}

/// Squares over those of the learned noise, and how many, fading.
#[derive(Debug, Clone, Copy, PartialEq, Default, CheckpointValue)]
struct NoiseTally {
    sum: f64,
    count: f64,
}

impl NoiseTally {
    /// Ratio of the variances; of nothing the least.
    fn ratio(&self) -> f64 {
        (self.sum / self.count.max(1.0)).max(RATIO_MIN)
    }

    fn take(&mut self, normalised_square: f64, largest: f64) {
        self.fade();
        self.sum += normalised_square.clamp(0.0, largest) / CLIPPED_MEAN;
        self.count += 1.0;
    }

    fn fade(&mut self) {
        self.sum *= FADING;
        self.count *= FADING;
    }
}

/// Outliers, and samples of which it was asked whether they are, fading.
#[derive(Debug, Clone, Copy, PartialEq, Default, CheckpointValue)]
struct OutlierTally {
    outliers: f64,
    asked: f64,
}

impl OutlierTally {
    fn take(&mut self, is_outlier: bool) {
        self.outliers = self.outliers * FADING + f64::from(u8::from(is_outlier));
        self.asked = self.asked * FADING + 1.0;
    }

    /// True if a sensor may have so many: one, or a small share.
    fn is_plausible(&self) -> bool {
        self.outliers <= 1.0 + OUTLIER_RATE_MAX * self.asked
    }
}

impl NoiseScale {
    /// Takes the square of a difference of some order, divided by its variance under the learned
    /// noise. What is too large is told by the noise as it is believed to be: so the estimate is
    /// right at every ratio, and not only near 1.
    pub fn push(&mut self, normalised_square: f64, order: u32) {
        if normalised_square.is_nan() {
            return;
        }
        let [_, before, last] = self.squares;
        self.squares = [
            before,
            last,
            normalised_square / self.leaning(DEVIANCE_ALONE),
        ];
        let impulse = IMPULSE[usize::from(order > 1)];
        let newest = self.squares.iter().rev();
        let is_outlier = impulse
            .iter()
            .zip(newest)
            .all(|(share, square)| *square > share * FAR);
        if is_outlier {
            self.squares = [0.0; 3];
        }
        match self.is_suspected {
            true => self.doubted_outliers.take(is_outlier),
            false => self.healthy_outliers.take(is_outlier),
        }
        self.take(normalised_square);
    }

    /// Takes one that does not tell an outlier: of intervals so unequal that a sample weighs little
    /// in one of its differences.
    fn push_uneven(&mut self, normalised_square: f64) {
        self.squares = [0.0; 3];
        if !normalised_square.is_nan() {
            self.take(normalised_square);
        }
    }

    fn take(&mut self, normalised_square: f64) {
        if !self.is_suspected {
            let largest = CLIP * self.healthy.ratio();
            self.healthy.take(normalised_square, largest);
            self.doubted.fade();
            return;
        }
        self.doubted.take(normalised_square, CLIP * RATIO_MAX);
        if self.doubted.count >= SETTLED && self.doubted.ratio() <= RATIO_MAX {
            self.healthy = std::mem::take(&mut self.doubted);
        }
    }

    /// The channel comes to be suspected, or is so no more.
    fn suspect(&mut self, is_suspected: bool) {
        if !is_suspected {
            self.healthy_outliers = self.outliers();
            self.doubted_outliers = OutlierTally::default();
        }
        self.is_suspected = is_suspected;
    }

    /// Outliers of the healthy channel, and those under suspicion if a sensor may have so many.
    fn outliers(&self) -> OutlierTally {
        let (mut all, doubted) = (self.healthy_outliers, self.doubted_outliers);
        if doubted.is_plausible() {
            all.outliers += doubted.outliers;
            all.asked += doubted.asked;
        }
        all
    }

    /// Samples so far, fading.
    fn count(&self) -> f64 {
        self.healthy.count + self.doubted.count
    }

    /// Takes the first difference of a channel whose samples have the learned standard deviation
    /// `sd`, of which `expected` is no noise; a channel that `is_suspected` may be broken.
    pub fn push_step(
        &mut self,
        model: &Model,
        now: &Observation,
        sd: f64,
        [last_read, now_read]: [&Reading; 2],
        expected: f64,
        is_suspected: bool,
    ) {
        self.suspect(is_suspected);
        if last_read.plain == 0 || now_read.plain == 0 {
            return;
        }
        let sample = model.sample_variance(sd, now.frame_s);
        let step = now_read.mean - last_read.mean - expected;
        let variance = |read: &Reading| now.mean_variance(sample, read.plain);
        self.push(step * step / (variance(last_read) + variance(now_read)), 1);
    }

    /// True once the noise has been seen often enough.
    #[must_use]
    pub fn is_known(&self) -> bool {
        self.count() >= PRIOR + KNOWN
    }

    /// Share of the samples that are outliers.
    #[must_use]
    pub fn outlier_rate(&self) -> f64 {
        let OutlierTally { outliers, asked } = self.outliers();
        (outliers / asked).clamp(OUTLIER_RATE_MIN, OUTLIER_RATE_MAX)
    }

    /// Ratio of the variances. It is larger than its estimate by as much as makes residuals of
    /// [`DEVIANCE`] no less likely than by Student's t, the distribution of residuals whose
    /// variance is an estimate: false alarms come from noise taken as smaller than it is.
    #[must_use]
    pub fn variance_ratio(&self) -> f64 {
        self.ratio(DEVIANCE)
    }

    fn ratio(&self, deviance: f64) -> f64 {
        self.leaning(deviance).clamp(RATIO_MIN, RATIO_MAX)
    }

    /// The same without bounds: of a channel that may be broken.
    fn leaning(&self, deviance: f64) -> f64 {
        // Second differences are correlated by -2/3 and 1/6: 2 (1 + 2 (4/9 + 1/36)) = 3.9.
        let freedom = 2.0 * self.healthy.count / 3.9;
        let wider = deviance / ((freedom + 1.0) * (deviance / freedom).ln_1p());
        self.healthy.ratio() * wider
    }
}

/// Samples of a channel after which its noise counts as known. With the prior's, the variance is
/// known within sqrt(3.9 / 29) = 37 %.
const KNOWN: f64 = 25.0;
/// Change of the command (speed, m/s, or curvature, 1/m) up to which it counts as the same: chosen,
/// a thousandth of the most.
pub(super) const STEADY_COMMAND: f64 = 1e-3;

/// Time in motion after which a channel's noise should have been seen, s. Five times as long as it
/// takes where the command is steady.
pub(super) const UNSEEN_S: f64 = 5.0;
/// Ratio of the variances that is assumed where it was not: too noisy is safer than too quiet. Four
/// times the learned deviation, the largest being five.
const UNSEEN: f64 = 16.0;

/// How noisy the sensors are, from differences between successive observations.
#[derive(Debug, Clone, Copy, PartialEq, Default, CheckpointValue)]
pub struct SensorNoise {
    moved_s: f64,
    pose: [NoiseScale; 3],
    wheels: [NoiseScale; WHEELS],
    steer: [NoiseScale; WHEELS],
    history: [Option<Observation>; 2],
}

impl SensorNoise {
    /// The ratios at present.
    #[must_use]
    pub fn scales(&self) -> NoiseScales {
        let sd = |scale: &NoiseScale, deviance: f64| {
            let unseen = match self.moved_s < UNSEEN_S {
                true => 0.0,
                false => ((PRIOR + KNOWN - scale.count()) / KNOWN).clamp(0.0, 1.0),
            };
            let ratio = scale.ratio(deviance);
            (ratio + unseen * (UNSEEN - ratio).max(0.0)).sqrt()
        };
        let alone = |scale: &NoiseScale| sd(scale, DEVIANCE_ALONE);
        NoiseScales {
            pose: self.pose.each_ref().map(|scale| sd(scale, DEVIANCE)),
            wheels: self.wheels.each_ref().map(alone),
            steer: self.steer.each_ref().map(alone),
            outliers: OutlierRates {
                pose: outlier_rates(&self.pose),
                wheels: outlier_rates(&self.wheels),
                steer: outlier_rates(&self.steer),
            },
        }
    }

    /// Time in motion so far, s.
    #[must_use]
    pub const fn moved_s(&self) -> f64 {
        self.moved_s
    }

    /// True once the noise of the pose, and of a wheel if they are used, has been seen often
    /// enough: a broken encoder shows none.
    #[must_use]
    pub fn is_known(&self, use_wheels: bool) -> bool {
        let is_known = NoiseScale::is_known;
        self.pose.iter().all(is_known) && (!use_wheels || self.wheels.iter().any(is_known))
    }

    /// Second differences of the pose and first differences of wheel rates and steering angles,
    /// less what the nominal motion makes of them: neither a curve nor a fault that persists shows.
    /// The noise of wheels and angles that are suspected may be the fault.
    pub fn update(
        &mut self,
        model: &Model,
        robot: &Description,
        now: &Observation,
        suspects: Suspects,
    ) {
        // A robot at rest shows nothing of its noise.
        self.moved_s += now.moved_s();
        let [before, last] = self.history;
        self.history = [last, Some(*now)];
        let (Some(before), Some(last)) = (before, last) else {
            return;
        };
        let all = [&before, &last, now];
        if !all.iter().all(|o| o.is_steady()) || now.anchor || last.anchor {
            return;
        }
        if all.iter().all(|o| o.pose_frames > 0) {
            let (up, down) = (apart(model, &last, now), apart(model, &before, &last));
            let [a, b, c] = all.map(|o| o.pose_variance(model, [1.0; 3]));
            // Of intervals as long as they are: what departs at a constant rate leaves nothing.
            let longer = now.middles_s / last.middles_s;
            let is_even = (1.0 / EVEN..EVEN).contains(&longer);
            let (first, middle) = (longer * longer, (1.0 + longer) * (1.0 + longer));
            for i in 0..a.len() {
                let bend = up[i] - longer * down[i];
                let variance = first * a[i] + middle * b[i] + c[i];
                match is_even {
                    true => self.pose[i].push(bend * bend / variance, 2),
                    false => self.pose[i].push_uneven(bend * bend / variance),
                }
            }
        }
        let surge = (now.command[1] - last.command[1]).abs();
        if surge < STEADY_COMMAND {
            let count = robot.wheels.len().min(WHEELS);
            let (rate, angle) = (model.noise.wheel_rate_rad_s, model.noise.steer_rad);
            let turns = |o: &Observation, i| rolling_rate(robot, i, o.command[0], o.command[1]);
            let steers = |o: &Observation, i| steering_angle(robot, i, o.command[0]);
            for i in 0..count {
                let expected = turns(now, i) - turns(&last, i);
                let readings = [&last.wheels[i], &now.wheels[i]];
                let suspected = suspects.has(Slot::wheel_rate(i));
                self.wheels[i].push_step(model, now, rate, readings, expected, suspected);
                let expected = steers(now, i) - steers(&last, i);
                let readings = [&last.steer[i], &now.steer[i]];
                let suspected = suspects.has(Slot::steer(i));
                self.steer[i].push_step(model, now, angle, readings, expected, suspected);
            }
        }
    }
}

/// Outlier rates of channels of one kind: at least what was seen of all together, but for the one
/// that has most, which may be broken.
fn outlier_rates<const N: usize>(all: &[NoiseScale; N]) -> [f64; N] {
    let tallies = all.each_ref().map(NoiseScale::outliers);
    let most = |a: &&OutlierTally, b: &&OutlierTally| a.outliers.total_cmp(&b.outliers);
    let most = tallies.iter().max_by(most).copied().unwrap_or_default();
    let sum = |of: fn(&OutlierTally) -> f64| tallies.iter().map(of).sum::<f64>() - of(&most);
    let (outliers, count) = (sum(|tally| tally.outliers), sum(|tally| tally.asked));
    let usual = (outliers + EXPECTED) / count;
    let bounded = |rate: f64| rate.clamp(OUTLIER_RATE_MIN, OUTLIER_RATE_MAX);
    all.each_ref()
        .map(|scale| bounded(scale.outlier_rate().max(usual)))
}

/// Displacement from one measured pose to the next (x, y, yaw), less that of the nominal motion.
fn apart(model: &Model, last: &Observation, now: &Observation) -> [f64; 3] {
    let step = now.displacement(model, &model.nominal.motion);
    let [turn, forward, left] = step.per_metre.map(|per_metre| per_metre * step.travel_m);
    let (sin, cos) = (last.pose[2] + 0.5 * turn).sin_cos();
    [
        now.pose[0] - last.pose[0] - (cos * forward - sin * left),
        now.pose[1] - last.pose[1] - (sin * forward + cos * left),
        wrap(wrap(now.pose[2] - last.pose[2]) - turn),
    ]
}

#[cfg(test)]
mod tests;
