//! Two faults at once: a sensor whose readings say nothing, and what all others say then.

use vigil_checkpoint::CheckpointValue;
use vigil_inference::logspace::{log_add, log_sum_exp};

use super::{Bank, ERRATIC, IMPOSSIBLE, KINDS_MAX, Weighed};
use crate::channel_model::fault_kind::{DRIVE_KINDS, FaultKind, SENSOR_KINDS};
use crate::channel_model::law::BLOCKS;
use crate::channel_model::scatter::STILL_MAX;
use crate::channel_model::{CHANNELS_MAX, COMPONENTS_MAX};

/// Mean square of the residuals, where healthy ones have 1, up to which no second fault is looked
/// for. Chosen: what a window of health seldom has.
const UNEXPLAINED: f64 = 3.0;

/// Place of [`FaultKind::Erratic`] among the kinds of a sensor.
const ERRATIC_PLACE: usize = SENSOR_KINDS.len() - 1;
const _: () = assert!(matches!(SENSOR_KINDS[ERRATIC_PLACE], FaultKind::Erratic));

/// Two faults at once of which one is a sensor's.
#[derive(Debug, Clone, Copy, PartialEq, CheckpointValue)]
pub struct SensorPair {
    /// Their components: the sensor, then the other.
    pub components: [usize; 2],
    /// Logarithm of how much more likely the window is with both than without a fault.
    pub log_ratio: f64,
}

impl Bank {
    /// The likeliest two faults of which one is the sensor whose silence explains most; none if the
    /// window is explained without a second one.
    #[must_use]
    pub const fn pair(&self) -> Option<SensorPair> {
        self.pair
    }

    /// Looks for a second fault beside the sensor whose silence explains most, and adds what is
    /// said of that one if all its channels say nothing.
    ///
    /// The likelihood of A and B is that of A saying nothing, times that of B under the law of the
    /// other channels. A is the component of whose channels one alone explains most.
    pub(super) fn weigh_pair(&mut self) {
        self.pair = None;
        let (whole, values) = (self.law().square(), self.law().values() as f64);
        if self.first > 0 || whole <= UNEXPLAINED * values {
            return;
        }
        let silence =
            |bank: &Self, component: usize| bank.weighed[component][ERRATIC_PLACE].log_ratio;
        let first = self
            .components()
            .max_by(|&a, &b| silence(self, a).total_cmp(&silence(self, b)));
        let Some(first) = first else { return };
        let n = self.channels.len();
        let is_first: [bool; CHANNELS_MAX] =
            std::array::from_fn(|i| i < n && self.channels[i].component == first);
        let mut others = self.window.z;
        let left_out = others.iter_mut().zip(is_first);
        left_out.for_each(|(row, is_first)| {
            if is_first {
                *row = [None; BLOCKS];
            }
        });
        let Some(law) = self.laws.without.get_mut(first) else {
            return;
        };
        law.take(&others[..n]);
        self.left_out = Some(first);
        self.silence_all(first, whole);
        let of_first = silence(self, first) - (KINDS_MAX as f64).ln();
        let weighed = self.weighed;
        let blocks = is_first.iter().filter(|is_first| **is_first).count() * BLOCKS;
        let second = (self.law().square() > UNEXPLAINED * (values - blocks as f64))
            .then(|| self.second(&is_first))
            .flatten();
        (self.weighed, self.left_out) = (weighed, None);
        self.pair = second.map(|(second, log_ratio)| SensorPair {
            components: [first, second],
            log_ratio: of_first + log_ratio,
        });
    }

    /// Adds what is said of a component if all its channels say nothing; without them the law is
    /// taken, with them the window had the square `whole`.
    fn silence_all(&mut self, component: usize, whole: f64) {
        let shares = self.components().filter(|&other| other == component);
        let shares = shares.count() as f64;
        if shares < 2.0 {
            return;
        }
        let law = self.law();
        let less = (whole - law.square()).max(0.0) * (1.0 - 1.0 / (ERRATIC * ERRATIC));
        let penalty = shares * law.blocks(0) as f64 * ERRATIC.ln() + shares.ln();
        let log_ratio = law.log_ratio_at(whole, less) - penalty;
        let age_s = self.window.block_s() * law.blocks(0) as f64;
        let slot = &mut self.weighed[component][ERRATIC_PLACE];
        let sum = log_sum_exp(&[slot.log_ratio, log_ratio]);
        if log_ratio > slot.log_ratio {
            *slot = Weighed {
                age_s,
                ..Weighed::NONE
            };
        }
        slot.log_ratio = sum;
    }

    /// The likeliest fault of the channels that are not left out. A sensor of which even silence
    /// would explain less than another fault does is not looked at.
    fn second(&mut self, left_out: &[bool; CHANNELS_MAX]) -> Option<(usize, f64)> {
        self.weighed = [[Weighed::NONE; KINDS_MAX]; COMPONENTS_MAX];
        let mut best = None;
        self.weigh_drives();
        for drive in 0..self.drives.len() {
            let component = self.drives[drive].component;
            best = likelier(best, (component, self.of_means(component, &DRIVE_KINDS)));
        }
        let mut bounds = [IMPOSSIBLE; COMPONENTS_MAX];
        for (channel, component) in self.components().enumerate() {
            if !left_out[channel] {
                let silenced = self.law().silenced(channel)[0];
                let bound = self.law().log_ratio(silenced, -STILL_MAX);
                bounds[component] = bound.max(bounds[component]);
            }
        }
        loop {
            let (component, bound) =
                bounds
                    .iter()
                    .enumerate()
                    .fold((0, IMPOSSIBLE), |most, (component, bound)| {
                        if *bound > most.1 {
                            (component, *bound)
                        } else {
                            most
                        }
                    });
            if bound <= best.map_or(IMPOSSIBLE, |(_, log_ratio)| log_ratio) {
                return best;
            }
            bounds[component] = IMPOSSIBLE;
            for channel in 0..self.channels.len() {
                if self.channels[channel].component == component {
                    self.weigh_sensor(channel);
                }
            }
            best = likelier(best, (component, self.of_means(component, &SENSOR_KINDS)));
        }
    }

    /// What is said of a component by the means alone: noise and silence are no matter of these,
    /// and the first sensor's are among them.
    fn of_means(&self, component: usize, kinds: &[FaultKind]) -> f64 {
        let places = self.weighed[component].iter().zip(kinds);
        let of_means = places.map(|(one, kind)| match kind {
            FaultKind::Noise | FaultKind::Rough | FaultKind::Missing => IMPOSSIBLE,
            _ => one.log_ratio,
        });
        of_means.fold(IMPOSSIBLE, log_add) - (KINDS_MAX as f64).ln()
    }
}

/// The likelier one of two components, with what is said of them, or of equals the first; none of
/// what is impossible.
fn likelier(best: Option<(usize, f64)>, other: (usize, f64)) -> Option<(usize, f64)> {
    let most = best.map_or(IMPOSSIBLE, |(_, log_ratio)| log_ratio);
    if other.1 > most { Some(other) } else { best }
}
