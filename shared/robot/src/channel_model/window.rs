//! The last few seconds of residuals and predictions, in blocks.

use vigil_checkpoint::{Checkpoint, CheckpointValue};

use super::channel::{CLIP, Channel, Commands, Scales};
use super::law::{BLOCK_S, BLOCKS, Row};
use super::level::Level;
use super::observation::History;
use super::prediction::Predictor;
use super::{CHANNELS_MAX, DRIVES_MAX};
use crate::description::INTERVAL_MIN_S;

/// Longest delay that is looked for, in blocks.
pub const DELAY_BLOCKS: usize = 4;
/// Observations of a block at most.
const BLOCK_MAX: usize = (BLOCK_S / INTERVAL_MIN_S + 0.5) as usize;
const RING: usize = BLOCK_MAX * (BLOCKS + DELAY_BLOCKS);
/// Motion after which a robot no longer speeds up, s.
const MOVES_S: f64 = 0.5;
/// Part of a drive's largest commanded speed that is added to show what an offset of it does.
pub const OFFSET: f64 = 0.1;

/// Time over which a run's own offset and gain are learned, s, and the part of a block's
/// information that is new.
const CONTEXT_S: f64 = 60.0;
const CONTEXT_SHARE: f64 = 0.5;
/// So many deviations of a run's own offset and gain are no fault.
const CONTEXT_MAX: f64 = 2.0;

/// A channel's own offset and gain in a run.
#[derive(Debug, Clone, Copy, CheckpointValue)]
struct Context {
    /// Sums of products of what they are multiplied by: of the offset, both, the gain.
    information: [f64; 3],
    /// Of these and the residuals.
    vector: [f64; 2],
    value: [f64; 2],
}

impl Context {
    const NONE: Self = Self {
        information: [0.0; 3],
        vector: [0.0; 2],
        value: [0.0; 2],
    };

    /// Takes a residual `z`, to which an offset of one adds `of[0]` and a gain `of[1]`.
    fn learn(&mut self, of: [f64; 2], z: f64, weight: f64, dt_s: f64) {
        let [of_offset, of_gain] = of;
        let keep = (-dt_s / CONTEXT_S).exp();
        let products = [
            of_offset * of_offset,
            of_offset * of_gain,
            of_gain * of_gain,
        ];
        let information = self.information.iter_mut().zip(products);
        information.for_each(|(sum, product)| *sum = keep * *sum + weight * product);
        let vector = self.vector.iter_mut().zip(of);
        vector.for_each(|(sum, of)| *sum = keep * *sum + weight * of * z);
    }

    /// The mean under a prior with these deviations.
    fn solve(&mut self, sd: &[f64; 2]) {
        let prior = sd.map(|sd| 1.0 / (sd * sd).max(1e-12));
        let [a, b, c] = self.information;
        let (a, c) = (a + prior[0], c + prior[1]);
        let determinant = a * c - b * b;
        let [x, y] = self.vector;
        let mean = [(c * x - b * y) / determinant, (a * y - b * x) / determinant];
        for ((slot, value), sd) in self.value.iter_mut().zip(mean).zip(sd) {
            *slot = value.clamp(-CONTEXT_MAX * sd, CONTEXT_MAX * sd);
        }
    }
}

/// One observation.
#[derive(Debug, Clone, Copy, CheckpointValue)]
struct Moment {
    /// False for what came before the record began.
    is_there: bool,
    /// True if the robot has moved for a while: at rest nothing jolts.
    moves: bool,
    /// Whitened residuals.
    z: [Option<f64>; CHANNELS_MAX],
    /// One over the residuals' deviations.
    unit: [f64; CHANNELS_MAX],
    /// Predictions.
    predicted: [f64; CHANNELS_MAX],
    /// What each drive's part of the predictions is, whitened, and an offset of it.
    share: [[f64; CHANNELS_MAX]; DRIVES_MAX],
    offset: [[f64; CHANNELS_MAX]; DRIVES_MAX],
}

const NOTHING: Moment = Moment {
    is_there: false,
    moves: false,
    z: [None; CHANNELS_MAX],
    unit: [0.0; CHANNELS_MAX],
    predicted: [0.0; CHANNELS_MAX],
    share: [[0.0; CHANNELS_MAX]; DRIVES_MAX],
    offset: [[0.0; CHANNELS_MAX]; DRIVES_MAX],
};

/// Channels, as bits, with which something may be wrong: what is usual of them is not learned.
#[derive(Debug, Clone, Copy, Default, CheckpointValue)]
pub struct Suspects {
    /// Whose offset and gain are not learned.
    pub context: u64,
    /// Whose level is not followed.
    pub level: u64,
}

/// The window. Rows hold the means of its blocks, the oldest first.
#[derive(Debug, Clone, Checkpoint)]
pub struct Window {
    #[checkpoint(fixed)]
    channels: Vec<(usize, Channel)>,
    #[checkpoint(fixed)]
    predictor: Predictor,
    #[checkpoint(fixed)]
    scales: Scales,
    /// Observations of a block.
    per_block: usize,
    /// Length of an observation, s.
    interval_s: f64,
    ring: Vec<Moment>,
    newest: usize,
    context: [Context; CHANNELS_MAX],
    level: [Level; CHANNELS_MAX],
    /// Whitened residuals; none where a block holds no reading.
    pub z: [[Option<f64>; BLOCKS]; CHANNELS_MAX],
    /// One over the residual's deviation.
    pub unit: [Row; CHANNELS_MAX],
    /// Predictions over the residual's deviation.
    pub predicted: [Row; CHANNELS_MAX],
    /// Each drive's part of the whitened predictions.
    pub share: [[Row; CHANNELS_MAX]; DRIVES_MAX],
    /// That of an offset of a tenth of each drive's largest speed.
    pub offset: [[Row; CHANNELS_MAX]; DRIVES_MAX],
    /// Mean square of the change from one residual to the next in motion, and how many there were.
    pub roughness: [(f64, usize); CHANNELS_MAX],
    /// The same of the last second alone, and what it would be if nothing but the prediction had
    /// changed.
    pub newest_roughness: [[(f64, usize); 2]; CHANNELS_MAX],
}

impl Window {
    /// A window over the channels at these places of an observation.
    #[must_use]
    pub fn new(channels: Vec<(usize, Channel)>, scales: Scales, interval_s: f64) -> Self {
        let per_block = ((BLOCK_S / interval_s).round() as usize).clamp(1, BLOCK_MAX);
        Self {
            predictor: Predictor::new(channels.iter().map(|(_, channel)| channel)),
            channels,
            scales,
            per_block,
            interval_s,
            ring: vec![NOTHING; RING.min(per_block * (BLOCKS + DELAY_BLOCKS))],
            newest: 0,
            context: [Context::NONE; CHANNELS_MAX],
            level: [Level::default(); CHANNELS_MAX],
            z: [[None; BLOCKS]; CHANNELS_MAX],
            unit: [[0.0; BLOCKS]; CHANNELS_MAX],
            predicted: [[0.0; BLOCKS]; CHANNELS_MAX],
            share: [[[0.0; BLOCKS]; CHANNELS_MAX]; DRIVES_MAX],
            offset: [[[0.0; BLOCKS]; CHANNELS_MAX]; DRIVES_MAX],
            roughness: [(0.0, 0); CHANNELS_MAX],
            newest_roughness: [[(0.0, 0); 2]; CHANNELS_MAX],
        }
    }

    /// Drives.
    #[must_use]
    pub fn drives(&self) -> usize {
        self.scales.drives.len().min(DRIVES_MAX)
    }

    /// Length of a block, s.
    #[must_use]
    pub fn block_s(&self) -> f64 {
        self.per_block as f64 * self.interval_s
    }

    /// Observations of a block.
    #[must_use]
    pub const fn per_block(&self) -> usize {
        self.per_block
    }

    /// Forgets the run.
    pub fn reset(&mut self) {
        self.clear();
        self.context = [Context::NONE; CHANNELS_MAX];
        self.level = [Level::default(); CHANNELS_MAX];
    }

    /// Begins a new record of the same run.
    pub fn clear(&mut self) {
        for moment in &mut self.ring {
            moment.is_there = false;
        }
    }

    fn ago(&self, lag: usize) -> &Moment {
        let length = self.ring.len();
        &self.ring[(self.newest + length - lag % length) % length]
    }

    /// Takes the newest observation of `history`; deviations count `widening` times as much.
    pub fn push(
        &mut self,
        history: &History,
        commands: &Commands,
        (widening, held): (f64, Suspects),
    ) {
        let Some(now) = history.ago(0) else { return };
        self.learn_context(held.context, now.dt_s);
        self.newest = (self.newest + 1) % self.ring.len();
        let moment_before = match self.ago(1) {
            before if before.is_there => *before,
            _ => NOTHING,
        };
        let (was_there, last) = (moment_before.is_there, moment_before.predicted);
        let mut moment = NOTHING;
        moment.is_there = true;
        moment.moves = now.moving && now.moving_s >= MOVES_S;
        let of_commands = self.predictor.predict(commands, &self.scales);
        for (i, (place, channel)) in self.channels.iter().enumerate() {
            let apart = now.values[*place].map(|value| value - of_commands[i]);
            let apart = apart.filter(|_| channel.drifts);
            let predicted = of_commands[i] + self.level[i].advance(apart, now.dt_s);
            let before = if was_there { last[i] } else { predicted };
            let basis = Channel::basis(&now.command, &self.scales, predicted, before);
            let variance = match channel.drifts {
                true => channel.variance_at(basis) * self.level[i].variance(),
                false => channel.variance_at(basis),
            };
            let unit = 1.0 / (widening * variance.sqrt());
            // A single reading may be a glitch; what the one before confirms is none.
            let last = moment_before.z[i].unwrap_or(0.0) * unit / moment_before.unit[i].max(1e-300);
            let (low, high) = (last.min(0.0) - CLIP, last.max(0.0) + CLIP);
            let z = now.values[*place].map(|value| ((value - predicted) * unit).clamp(low, high));
            (moment.predicted[i], moment.unit[i], moment.z[i]) = (predicted, unit, z);
            if let Some(apart) = apart.filter(|_| held.level >> i & 1 == 0) {
                self.level[i].take(apart, CLIP / unit, now.dt_s);
            }
        }
        for d in 0..self.drives() {
            let (drive, speed) = (&self.scales.drives[d], self.scales.speeds[d]);
            let without = commands.map(|command| drive.without(&command));
            let more = commands.map(|command| {
                std::array::from_fn(|axis| command[axis] + OFFSET * speed * drive.effect[axis])
            });
            let without = self.predictor.predict(&without, &self.scales);
            let more = self.predictor.predict(&more, &self.scales);
            for i in 0..self.channels.len() {
                moment.share[d][i] = (of_commands[i] - without[i]) * moment.unit[i];
                moment.offset[d][i] = (more[i] - of_commands[i]) * moment.unit[i];
            }
        }
        let newest = self.newest;
        self.ring[newest] = moment;
        self.sum_up();
    }

    /// The observation that leaves the window tells the run's own offset and gain.
    fn learn_context(&mut self, held: u64, dt_s: f64) {
        let leaving = *self.ago(self.per_block * BLOCKS - 1);
        let weight = CONTEXT_SHARE / self.per_block as f64;
        for (i, (_, channel)) in self.channels.iter().enumerate() {
            let context = &mut self.context[i];
            if held >> i & 1 == 1 || !leaving.is_there {
                continue;
            }
            if let Some(z) = leaving.z[i] {
                let of_gain = leaving.predicted[i] * leaving.unit[i];
                context.learn([leaving.unit[i], of_gain], z, weight, dt_s);
                context.solve(&channel.context_sd);
            }
        }
    }

    fn sum_up(&mut self) {
        let (n, drives) = (self.channels.len(), self.drives());
        for i in 0..n {
            self.roughness[i] = (0.0, 0);
            self.newest_roughness[i] = [(0.0, 0); 2];
        }
        for block in 0..BLOCKS {
            let from = (BLOCKS - 1 - block) * self.per_block;
            let mut sums = NOTHING;
            let mut z = [None; CHANNELS_MAX];
            for lag in from..from + self.per_block {
                let length = self.ring.len();
                let at = (self.newest + length - lag) % length;
                let older = &self.ring[(at + length - 1) % length];
                let moment = &self.ring[at];
                if !moment.is_there {
                    continue;
                }
                for (i, sum) in z.iter_mut().enumerate().take(n) {
                    let Some(value) = moment.z[i] else { continue };
                    let [offset, gain] = self.context[i].value;
                    let expected = moment.unit[i] * (offset + gain * moment.predicted[i]);
                    *sum = Some(sum.unwrap_or(0.0) + value - expected);
                    sums.unit[i] += moment.unit[i];
                    // A whole sensor reads this run's own offset and gain as well.
                    sums.predicted[i] += moment.predicted[i] * moment.unit[i] + expected;
                    for d in 0..drives {
                        sums.share[d][i] += (1.0 + gain) * moment.share[d][i];
                        sums.offset[d][i] += (1.0 + gain) * moment.offset[d][i];
                    }
                    let before = older.z[i].filter(|_| older.is_there && moment.moves);
                    let Some(before) = before else { continue };
                    let of_prediction = (moment.predicted[i] - older.predicted[i]) * moment.unit[i];
                    let squares = [value - before, of_prediction]
                        .map(|x| 0.5 * (x * x).min(4.0 * CLIP * CLIP));
                    self.roughness[i].0 += squares[0];
                    self.roughness[i].1 += 1;
                    if block + 2 >= BLOCKS {
                        let newest = self.newest_roughness[i].iter_mut();
                        newest.zip(squares).for_each(|(sum, square)| {
                            sum.0 += square;
                            sum.1 += 1;
                        });
                    }
                }
            }
            // What was not measured counts as expected: of a few readings a mean is no better.
            let part = 1.0 / self.per_block as f64;
            for (i, sum) in z.iter().enumerate().take(n) {
                self.z[i][block] = sum.map(|sum: f64| part * sum);
                self.unit[i][block] = part * sums.unit[i];
                self.predicted[i][block] = part * sums.predicted[i];
                for d in 0..drives {
                    self.share[d][i][block] = part * sums.share[d][i];
                    self.offset[d][i][block] = part * sums.offset[d][i];
                }
            }
        }
        let newest = self.newest_roughness[..n].iter_mut().flatten();
        for (sum, count) in self.roughness[..n].iter_mut().chain(newest) {
            *sum /= (*count).max(1) as f64;
        }
    }

    /// Newest blocks that the record fills.
    #[must_use]
    pub fn whole_blocks(&self) -> usize {
        let there = (0..BLOCKS * self.per_block).take_while(|&lag| self.ago(lag).is_there);
        there.count() / self.per_block
    }

    /// How the whitened residuals of a channel change if it is late by so many blocks, halves
    /// included.
    #[must_use]
    pub fn delayed(&self, channel: usize, blocks: f64) -> Row {
        let part = 1.0 / self.per_block as f64;
        let late = (blocks * self.per_block as f64).round().max(1.0) as usize;
        std::array::from_fn(|block| {
            let from = (BLOCKS - 1 - block) * self.per_block;
            let mut sum = 0.0;
            for lag in from..from + self.per_block {
                let (now, then) = (self.ago(lag), self.ago(lag + late));
                if now.is_there && then.is_there && now.z[channel].is_some() {
                    sum += (then.predicted[channel] - now.predicted[channel]) * now.unit[channel];
                }
            }
            part * sum
        })
    }
}
