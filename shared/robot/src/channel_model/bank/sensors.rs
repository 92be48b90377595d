//! Faults of sensors: each is of one channel.

use vigil_inference::logspace::log_add;

use super::{Bank, ERRATIC, HELD, IMPOSSIBLE, JOINT_ONSETS, KINDS_MAX, ONSETS, Weighed};
use crate::channel_model::fault_kind::{FaultKind, GAIN_SD, SENSOR_KINDS};
use crate::channel_model::law::{BLOCKS, Change, OwnRow, Row};
use crate::channel_model::square::sums_from;
use crate::channel_model::window::DELAYS;

/// Time in which a drift grows as large as a bias, s.
const DRIFT_S: f64 = 4.0;
/// Silence after which a channel is missing, s, if it was never silent for half as long, and how
/// much that says.
const MISSING_S: f64 = 1.0;
const MISSING: f64 = 30.0;
/// Delays with their onsets.
const LATE: usize = DELAYS.len() * JOINT_ONSETS.len();

impl Bank {
    pub(super) fn weigh_sensor(&mut self, channel: usize) {
        let component = self.channels[channel].component;
        let found = self.sensor(channel);
        // The velocities of one pose share a component.
        let shares = self.components().filter(|&other| other == component);
        let price = (shares.count().max(1) as f64).ln();
        for (slot, found) in self.weighed[component].iter_mut().zip(found) {
            let log_ratio = found.log_ratio - price;
            let sum = match slot.log_ratio > IMPOSSIBLE {
                true => log_add(slot.log_ratio, log_ratio),
                false => log_ratio,
            };
            if log_ratio > slot.log_ratio {
                *slot = found;
            }
            slot.log_ratio = sum.max(IMPOSSIBLE);
        }
    }

    fn sensor(&self, channel: usize) -> [Weighed; KINDS_MAX] {
        let place = &self.channels[channel];
        let is_pose = place.target.quantity.is_pose();
        let bias_sd = self.bias_sd[channel];
        let silenced = self.law().silenced(channel);
        // A sensor that repeats itself is not as rough as it was.
        let newest = self.window.newest_roughness[channel];
        let scatter = self.laws.scatter.as_ref();
        let still = scatter.map_or(0.0, |scatter| scatter.still(channel, newest));
        let law = self.law();
        let unit = law.own_row(channel, &self.window.unit[channel]);
        let of_unit = law.change(channel, &unit);
        SENSOR_KINDS.map(|kind| match kind {
            FaultKind::Bias => self.sized(ONSETS, &of_unit, bias_sd),
            FaultKind::Gain => {
                let predicted = law.own_row(channel, &self.window.predicted[channel]);
                let change = self.sized(ONSETS, &law.change(channel, &predicted), GAIN_SD);
                Weighed {
                    size: 1.0 + change.size,
                    ..change
                }
            }
            // The velocity of a pose that drifts is biased, and one that stands is zero.
            FaultKind::Drift | FaultKind::Frozen if is_pose => Weighed::NONE,
            FaultKind::Drift => self.drifting(channel, (&unit, &of_unit), bias_sd / DRIFT_S),
            FaultKind::Frozen => self.frozen(channel, &unit, (&silenced, HELD - still)),
            FaultKind::Zero => self.zero(channel, &silenced, -still),
            FaultKind::Delay => self.delayed(channel),
            FaultKind::Erratic => self.erratic(&silenced),
            FaultKind::Noise => self.noisier(|i| i == channel),
            FaultKind::Missing if self.silent_s[channel] > MISSING_S.max(2.0 * place.silence_s) => {
                Weighed {
                    log_ratio: MISSING,
                    age_s: self.silent_s[channel],
                    ..Weighed::NONE
                }
            }
            _ => Weighed::NONE,
        })
    }

    /// What grows from some block on is what grows from the first one, less a bias.
    fn drifting(
        &self,
        channel: usize,
        (unit, of_unit): (&OwnRow, &[Change; BLOCKS]),
        size_sd: f64,
    ) -> Weighed {
        let (law, block_s) = (self.law(), self.window.block_s());
        let row = &self.window.unit[channel];
        let grown = std::array::from_fn(|block| row[block] * block_s * (block as f64 + 0.5));
        let grown = law.own_row(channel, &grown);
        let (of_grown, products) = (law.change(channel, &grown), grown.product(unit));
        let changes = std::array::from_fn(|first| {
            let less = first as f64 * block_s;
            Change {
                b: of_grown[first].b - less * of_unit[first].b,
                a: of_grown[first].a - less * (2.0 * products[first] - less * of_unit[first].a),
            }
        });
        self.sized(JOINT_ONSETS, &changes, size_sd)
    }

    fn delayed(&self, channel: usize) -> Weighed {
        let block_s = self.window.block_s();
        let mut less = [0.0; LATE];
        for (less, late) in less
            .chunks_exact_mut(JOINT_ONSETS.len())
            .zip(&self.window.late)
        {
            let late = self.law().own_row(channel, &late[channel]);
            let changes = self.law().change(channel, &late);
            let onsets = less.iter_mut().zip(JOINT_ONSETS);
            onsets.for_each(|(less, first)| *less = changes[first].less());
        }
        let found = self.law().likelihoods(less, [1.0; LATE]);
        let whole: f64 = found.multiples.iter().sum();
        let of_delays = found.multiples.chunks_exact(JOINT_ONSETS.len());
        let shares = of_delays.map(|onsets| onsets.iter().sum::<f64>() / whole);
        let (mut size, mut square) = (0.0, 0.0);
        for (share, blocks) in shares.zip(DELAYS) {
            let (late_s, sd_s) = (block_s * blocks, 0.25 * block_s * blocks);
            size += share * late_s;
            square += share * (late_s * late_s + sd_s * sd_s);
        }
        Weighed {
            log_ratio: found.log_mean(),
            size,
            size_sd: (square - size * size).max(0.0).sqrt(),
            age_s: block_s * BLOCKS as f64,
        }
    }

    /// Readings that say nothing of the truth, but follow what such a sensor reads; `left` are the
    /// squares of the distance from that, from each block on.
    fn replaced(&self, silenced: &Row, left: &Row, price: f64) -> Weighed {
        let (found, _) = self.begun(ONSETS, |first| silenced[first] - left[first], |_| 1.0);
        Weighed {
            log_ratio: found.log_ratio - price,
            ..found
        }
    }

    fn zero(&self, channel: usize, silenced: &Row, price: f64) -> Weighed {
        let (z, predicted) = (self.law().row(channel), &self.window.predicted[channel]);
        let apart: Row = std::array::from_fn(|block| z[block] + predicted[block]);
        let left = self.law().own_row(channel, &apart).square();
        self.replaced(silenced, &left, price)
    }

    fn frozen(&self, channel: usize, of_unit: &OwnRow, (silenced, price): (&Row, f64)) -> Weighed {
        let law = self.law();
        let (z, unit) = (law.row(channel), &self.window.unit[channel]);
        let predicted = &self.window.predicted[channel];
        let is_there = unit.map(|unit| f64::from(u8::from(unit > 0.0)));
        let counts = sums_from(is_there);
        let sums = sums_from(std::array::from_fn(|block| match unit[block] > 0.0 {
            true => (z[block] + predicted[block]) / unit[block],
            false => 0.0,
        }));
        // The value at which it is held if it is so from each block on.
        let held: Row = std::array::from_fn(|first| sums[first] / counts[first].max(1.0));
        // The square of `apart - change * unit`, from a value near to all of these.
        let apart: Row =
            std::array::from_fn(|block| z[block] + predicted[block] - held[0] * unit[block]);
        let apart = law.own_row(channel, &apart);
        let squares = [&apart, of_unit].map(OwnRow::square);
        let products = apart.product(of_unit);
        let left = std::array::from_fn(|first| {
            let change = held[first] - held[0];
            squares[0][first] - change * (2.0 * products[first] - change * squares[1][first])
        });
        self.replaced(silenced, &left, price)
    }

    fn erratic(&self, silenced: &Row) -> Weighed {
        let less = |first: usize| silenced[first] * (1.0 - 1.0 / (ERRATIC * ERRATIC));
        let density = |first: usize| ERRATIC.powi(-(self.law().blocks(first) as i32));
        self.begun(ONSETS, less, density).0
    }
}
