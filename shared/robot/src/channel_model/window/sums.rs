//! The sums of which a window holds the means.

use vigil_checkpoint::CheckpointValue;

use super::DELAYS;
use crate::channel_model::{CHANNELS_MAX, DRIVES_MAX};

/// A value for each channel.
type Values = [f64; CHANNELS_MAX];

const NONE: Values = [0.0; CHANNELS_MAX];

/// Sums over the readings of some observations, by channel.
#[derive(Debug, Clone, Copy, CheckpointValue)]
pub struct Sums {
    /// How many readings there are.
    pub count: Values,
    /// Of whitened residuals.
    pub z: Values,
    /// Of one over the residuals' deviations.
    pub unit: Values,
    /// Of whitened predictions.
    pub predicted: Values,
    /// Of how residuals change if the sensor is late by each of [`DELAYS`].
    pub late: [Values; DELAYS.len()],
    /// Of the part of the whitened predictions of a drive of each group, and of an offset of it.
    pub share: [Values; DRIVES_MAX],
    pub offset: [Values; DRIVES_MAX],
    /// How many changes from one reading to the next there are in motion.
    pub changes: Values,
    /// Of half the squares of these, and of what they would be if only the prediction changed.
    pub rough: Values,
    pub moved: Values,
}

impl Sums {
    /// Of nothing.
    pub const ZERO: Self = Self {
        count: NONE,
        z: NONE,
        unit: NONE,
        predicted: NONE,
        late: [NONE; DELAYS.len()],
        share: [NONE; DRIVES_MAX],
        offset: [NONE; DRIVES_MAX],
        changes: NONE,
        rough: NONE,
        moved: NONE,
    };

    /// Adds those of other observations, of so many channels and groups of drives.
    pub fn add(&mut self, other: &Self, channels: usize, groups: usize) {
        let add = |sums: &mut Values, more: &Values| {
            let sums = sums.iter_mut().zip(more).take(channels);
            sums.for_each(|(sum, more)| *sum += more);
        };
        add(&mut self.count, &other.count);
        add(&mut self.z, &other.z);
        add(&mut self.unit, &other.unit);
        add(&mut self.predicted, &other.predicted);
        for (sums, more) in self.late.iter_mut().zip(&other.late) {
            add(sums, more);
        }
        let shares = self.share.iter_mut().zip(&other.share);
        let offsets = self.offset.iter_mut().zip(&other.offset);
        for (sums, more) in shares.take(groups).chain(offsets.take(groups)) {
            add(sums, more);
        }
        add(&mut self.changes, &other.changes);
        add(&mut self.rough, &other.rough);
        add(&mut self.moved, &other.moved);
    }
}
