//! The last few seconds of residuals and predictions, in blocks.

mod context;
mod sums;

use vigil_checkpoint::{Checkpoint, CheckpointValue};

use super::channel::{CLIP, Channel, Commands, Scales};
use super::component::Drive;
use super::law::{BLOCK_S, BLOCKS, Row};
use super::level::Level;
use super::observation::History;
use super::prediction::Predictor;
use super::{CHANNELS_MAX, DRIVES_MAX};
use crate::description::INTERVAL_MIN_S;

use context::Context;
use sums::Sums;

/// Delays that are looked for, in blocks; one with a size of its own between them.
pub const DELAYS: [f64; 4] = [0.5, 1.0, 2.0, 4.0];
/// Observations of a block at most.
const BLOCK_MAX: usize = (BLOCK_S / INTERVAL_MIN_S + 0.5) as usize;
/// Motion after which a robot no longer speeds up, s.
const MOVES_S: f64 = 0.5;
/// Part of a drive's largest commanded speed that is added to show what an offset of it does.
pub const OFFSET: f64 = 0.1;
/// Part of a block's information on a run's own offset and gain that is new.
const CONTEXT_SHARE: f64 = 0.5;

/// One observation.
#[derive(Debug, Clone, Copy, CheckpointValue)]
struct Moment {
    /// Whitened residuals.
    z: [Option<f64>; CHANNELS_MAX],
    /// One over the residuals' deviations.
    unit: [f64; CHANNELS_MAX],
    /// Predictions.
    predicted: [f64; CHANNELS_MAX],
}

const NOTHING: Moment = Moment {
    z: [None; CHANNELS_MAX],
    unit: [0.0; CHANNELS_MAX],
    predicted: [0.0; CHANNELS_MAX],
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
    /// Group of each drive: those that move the robot in the same way.
    #[checkpoint(fixed)]
    groups: Vec<usize>,
    ring: Vec<Moment>,
    newest: usize,
    /// Observations since the record began, at most as many as the ring holds.
    count: usize,
    /// What each observation of the newest block adds to its sums.
    parts: Vec<Sums>,
    newest_part: usize,
    /// Sums of the blocks that end with each observation of the ring.
    blocks: Vec<Sums>,
    context: [Context; CHANNELS_MAX],
    level: [Level; CHANNELS_MAX],
    /// Whitened residuals; none where a block holds no reading.
    pub z: [[Option<f64>; BLOCKS]; CHANNELS_MAX],
    /// One over the residual's deviation.
    pub unit: [Row; CHANNELS_MAX],
    /// Predictions over the residual's deviation.
    pub predicted: [Row; CHANNELS_MAX],
    /// How the whitened residuals of each channel change if it is late by each of [`DELAYS`].
    pub late: [[Row; CHANNELS_MAX]; DELAYS.len()],
    /// The part of the whitened predictions of a drive of each group.
    pub share: [[Row; CHANNELS_MAX]; DRIVES_MAX],
    /// That of an offset of a tenth of such a drive's largest speed.
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
        let length = per_block * BLOCKS;
        Self {
            predictor: Predictor::new(channels.iter().map(|(_, channel)| channel)),
            channels,
            groups: groups(&scales.drives),
            scales,
            per_block,
            interval_s,
            ring: vec![NOTHING; length],
            newest: 0,
            count: 0,
            parts: vec![Sums::ZERO; per_block],
            newest_part: 0,
            blocks: vec![Sums::ZERO; length],
            context: [Context::NONE; CHANNELS_MAX],
            level: [Level::default(); CHANNELS_MAX],
            z: [[None; BLOCKS]; CHANNELS_MAX],
            unit: [[0.0; BLOCKS]; CHANNELS_MAX],
            predicted: [[0.0; BLOCKS]; CHANNELS_MAX],
            late: [[[0.0; BLOCKS]; CHANNELS_MAX]; DELAYS.len()],
            share: [[[0.0; BLOCKS]; CHANNELS_MAX]; DRIVES_MAX],
            offset: [[[0.0; BLOCKS]; CHANNELS_MAX]; DRIVES_MAX],
            roughness: [(0.0, 0); CHANNELS_MAX],
            newest_roughness: [[(0.0, 0); 2]; CHANNELS_MAX],
        }
    }

    /// Drives.
    #[must_use]
    pub fn drives(&self) -> usize {
        self.groups.len()
    }

    /// Group of a drive: those that move the robot in the same way.
    #[must_use]
    pub fn group(&self, drive: usize) -> usize {
        self.groups[drive]
    }

    /// Groups of drives.
    #[must_use]
    pub fn groups(&self) -> usize {
        self.groups.iter().max().map_or(0, |last| last + 1)
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
        // A robot that waits calls it with each observation: its sums are zero already.
        if self.count == 0 {
            return;
        }
        self.count = 0;
        self.parts.fill(Sums::ZERO);
        self.blocks.fill(Sums::ZERO);
    }

    /// Place in the ring of the observation so many before the newest.
    fn place(&self, lag: usize) -> usize {
        match self.newest.checked_sub(lag) {
            Some(place) => place,
            None => self.newest + self.ring.len() - lag,
        }
    }

    fn ago(&self, lag: usize) -> Option<&Moment> {
        (lag < self.count).then(|| &self.ring[self.place(lag)])
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
        let before = self.ago(0).copied();
        let mut moment = NOTHING;
        let of_commands = self.predictor.predict(commands, &self.scales);
        for (i, (place, channel)) in self.channels.iter().enumerate() {
            let apart = now.values[*place].map(|value| value - of_commands[i]);
            let apart = apart.filter(|_| channel.drifts);
            let predicted = of_commands[i] + self.level[i].advance(apart, now.dt_s);
            let predicted_before = before.map_or(predicted, |before| before.predicted[i]);
            let basis = Channel::basis(&now.command, &self.scales, predicted, predicted_before);
            let variance = match channel.drifts {
                true => channel.variance_at(basis) * self.level[i].variance(),
                false => channel.variance_at(basis),
            };
            let unit = 1.0 / (widening * variance.sqrt());
            // A single reading may be a glitch; what the one before confirms is none.
            let last = before.map_or(0.0, |before| {
                before.z[i].unwrap_or(0.0) * unit / before.unit[i].max(1e-300)
            });
            let (low, high) = (last.min(0.0) - CLIP, last.max(0.0) + CLIP);
            let z = now.values[*place].map(|value| ((value - predicted) * unit).clamp(low, high));
            (moment.predicted[i], moment.unit[i], moment.z[i]) = (predicted, unit, z);
            if let Some(apart) = apart.filter(|_| held.level >> i & 1 == 0) {
                self.level[i].take(apart, CLIP / unit, now.dt_s);
            }
        }
        self.newest = (self.newest + 1) % self.ring.len();
        self.count = (self.count + 1).min(self.ring.len());
        let newest = self.newest;
        self.ring[newest] = moment;
        // At rest nothing jolts.
        let moves = now.moving && now.moving_s >= MOVES_S;
        let mut sums = self.sums(before.as_ref().filter(|_| moves));
        self.add_drives(&mut sums, commands, &of_commands);
        self.newest_part = (self.newest_part + 1) % self.per_block;
        self.parts[self.newest_part] = sums;
        let (channels, groups) = (self.channels.len(), self.groups());
        let block = &mut self.blocks[newest];
        *block = Sums::ZERO;
        // In the order of time, so that equal observations give equal sums.
        let (newer, older) = self.parts.split_at(self.newest_part + 1);
        for part in older.iter().chain(newer) {
            block.add(part, channels, groups);
        }
        self.average();
    }

    /// What the newest observation adds to the sums of its block; `before`: the one before it, if
    /// the change since then is one of a healthy robot's noise.
    fn sums(&self, before: Option<&Moment>) -> Sums {
        let (mut sums, moment) = (Sums::ZERO, &self.ring[self.newest]);
        let then = DELAYS.map(|blocks| {
            let lag = (blocks * self.per_block as f64).round().max(1.0) as usize;
            self.ago(lag).map(|moment| &moment.predicted)
        });
        for i in 0..self.channels.len() {
            let Some(z) = moment.z[i] else { continue };
            let (unit, predicted) = (moment.unit[i], moment.predicted[i]);
            sums.count[i] = 1.0;
            (sums.z[i], sums.unit[i], sums.predicted[i]) = (z, unit, predicted * unit);
            for (late, then) in sums.late.iter_mut().zip(then) {
                late[i] = then.map_or(0.0, |then| (then[i] - predicted) * unit);
            }
            let last = before.and_then(|before| Some((before.z[i]?, before.predicted[i])));
            if let Some((z_last, predicted_last)) = last {
                let of_prediction = (predicted - predicted_last) * unit;
                let square = |x: f64| 0.5 * (x * x).min(4.0 * CLIP * CLIP);
                sums.changes[i] = 1.0;
                (sums.rough[i], sums.moved[i]) = (square(z - z_last), square(of_prediction));
            }
        }
        sums
    }

    /// Adds what the drives' parts of the newest observation are; `of_commands`: the predictions of
    /// all channels, without their levels.
    fn add_drives(
        &mut self,
        sums: &mut Sums,
        commands: &Commands,
        of_commands: &[f64; CHANNELS_MAX],
    ) {
        for group in 0..self.groups() {
            let mut drives = self.groups.iter();
            let Some(first) = drives.position(|of_drive| *of_drive == group) else {
                continue;
            };
            let (drive, speed) = (&self.scales.drives[first], self.scales.speeds[first]);
            let without = commands.map(|command| drive.without(&command));
            let more = commands.map(|command| {
                std::array::from_fn(|axis| command[axis] + OFFSET * speed * drive.effect[axis])
            });
            let without = self.predictor.predict(&without, &self.scales);
            let more = self.predictor.predict(&more, &self.scales);
            // Zero where nothing was measured.
            for (i, unit) in sums.unit.iter().enumerate().take(self.channels.len()) {
                sums.share[group][i] = (of_commands[i] - without[i]) * unit;
                sums.offset[group][i] = (more[i] - of_commands[i]) * unit;
            }
        }
    }

    /// The observation that leaves the window tells the run's own offset and gain.
    fn learn_context(&mut self, held: u64, dt_s: f64) {
        let Some(leaving) = self.ago(self.per_block * BLOCKS - 1).copied() else {
            return;
        };
        let weight = CONTEXT_SHARE / self.per_block as f64;
        for (i, (_, channel)) in self.channels.iter().enumerate() {
            let Some(z) = leaving.z[i].filter(|_| held >> i & 1 == 0) else {
                continue;
            };
            let of_gain = leaving.predicted[i] * leaving.unit[i];
            let context = &mut self.context[i];
            context.learn([leaving.unit[i], of_gain], z, weight, dt_s);
            context.solve(&channel.context_sd);
        }
    }

    /// Fills the rows with the means of the blocks.
    fn average(&mut self) {
        let (n, groups) = (self.channels.len(), self.groups());
        // What was not measured counts as expected: of a few readings a mean is no better.
        let part = 1.0 / self.per_block as f64;
        self.roughness = [(0.0, 0); CHANNELS_MAX];
        self.newest_roughness = [[(0.0, 0); 2]; CHANNELS_MAX];
        for block in 0..BLOCKS {
            let sums = &self.blocks[self.place((BLOCKS - 1 - block) * self.per_block)];
            for i in 0..n {
                let [offset, gain] = self.context[i].value;
                let expected = offset * sums.unit[i] + gain * sums.predicted[i];
                let z = part * (sums.z[i] - expected);
                self.z[i][block] = (sums.count[i] > 0.0).then_some(z);
                self.unit[i][block] = part * sums.unit[i];
                // A whole sensor reads this run's own offset and gain as well.
                self.predicted[i][block] = part * (sums.predicted[i] + expected);
                for (row, late) in self.late.iter_mut().zip(&sums.late) {
                    row[i][block] = part * late[i];
                }
                let gain = part * (1.0 + gain);
                for group in 0..groups {
                    self.share[group][i][block] = gain * sums.share[group][i];
                    self.offset[group][i][block] = gain * sums.offset[group][i];
                }
                let changes = sums.changes[i] as usize;
                let add = |(sum, count): &mut (f64, usize), square: f64| {
                    *sum += square;
                    *count += changes;
                };
                add(&mut self.roughness[i], sums.rough[i]);
                if block + 2 >= BLOCKS {
                    let [read, predicted] = &mut self.newest_roughness[i];
                    add(read, sums.rough[i]);
                    add(predicted, sums.moved[i]);
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
        self.count / self.per_block
    }
}

/// Groups of drives that move the robot in the same way, numbered by their first ones.
fn groups(drives: &[Drive]) -> Vec<usize> {
    let mut groups: Vec<usize> = Vec::new();
    for (i, drive) in drives.iter().enumerate().take(DRIVES_MAX) {
        let like = drives[..i].iter().position(|other| drive.moves_like(other));
        let next = groups.iter().max().map_or(0, |last| last + 1);
        groups.push(like.map_or(next, |like| groups[like]));
    }
    groups
}
