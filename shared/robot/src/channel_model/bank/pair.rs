//! Two faults at once: a sensor whose readings say nothing, and what all others say then.

use vigil_inference::logspace::log_sum_exp;

use super::{Bank, IMPOSSIBLE, KINDS_MAX};
use crate::channel_model::fault_kind::{FaultKind, SENSOR_KINDS};
use crate::channel_model::law::BLOCKS;
use crate::channel_model::{CHANNELS_MAX, COMPONENTS_MAX};

/// Mean square of the residuals, where healthy ones have 1, up to which no second fault is looked
/// for. Chosen: what a window of health seldom has.
const UNEXPLAINED: f64 = 3.0;

/// Two faults at once of which one is a sensor's.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SensorPair {
    /// Their components: the sensor, then the other.
    pub components: [usize; 2],
    /// Logarithm of how much more likely the window is with both than without a fault.
    pub log_ratio: f64,
}

impl Bank {
    /// The likeliest two faults of which one is the sensor whose silence explains most; none if the
    /// window is explained without a second one.
    ///
    /// With the readings of sensor A left out, the law of all others is a marginal one, but for
    /// what other blocks tell of A's. So the likelihood of A and B is that of A saying nothing,
    /// times that of B without A's channels.
    pub fn weigh_pair(&mut self) -> Option<SensorPair> {
        let values = self.law().values() as f64;
        if self.law().square() <= UNEXPLAINED * values {
            return None;
        }
        let erratic = SENSOR_KINDS
            .iter()
            .position(|kind| *kind == FaultKind::Erratic)?;
        let silence = |bank: &Self, component: usize| bank.weighed[component][erratic].log_ratio;
        let first = self
            .components()
            .max_by(|&a, &b| silence(self, a).total_cmp(&silence(self, b)))?;
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
        let of_first = silence(self, first);
        let whole = self.weighed;
        let index = self.first.min(self.laws.mean.len() - 1);
        self.laws.mean[index].take(&others[..n]);
        let second = (self.law().square() > UNEXPLAINED * values)
            .then(|| self.second(&is_first))
            .flatten();
        self.laws.mean[index].take(&self.window.z[..n]);
        self.weighed = whole;
        second.map(|(second, log_ratio)| SensorPair {
            components: [first, second],
            log_ratio: of_first + log_ratio,
        })
    }

    /// The likeliest fault of the channels that are not left out.
    fn second(&mut self, left_out: &[bool; CHANNELS_MAX]) -> Option<(usize, f64)> {
        self.weighed = [[super::Weighed::NONE; KINDS_MAX]; COMPONENTS_MAX];
        for channel in (0..self.channels.len()).filter(|&channel| !left_out[channel]) {
            self.weigh_sensor(channel);
        }
        for drive in 0..self.drives.len() {
            self.weigh_drive(drive);
        }
        let total = |component: usize| {
            let kinds = self.weighed[component].map(|one| one.log_ratio);
            log_sum_exp(&kinds) - (KINDS_MAX as f64).ln()
        };
        let others = self
            .components()
            .chain(self.drives.iter().map(|one| one.component));
        let rated = others.map(|component| (component, total(component)));
        let best = rated.max_by(|a, b| a.1.total_cmp(&b.1))?;
        (best.1 > IMPOSSIBLE).then_some(best)
    }
}
