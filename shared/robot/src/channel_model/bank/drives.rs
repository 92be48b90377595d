//! Faults of drives: what each changes in all channels at once.

use super::{Bank, DRIVE_ONSETS, DrivePlace, ERRATIC, Weighed};
use crate::channel_model::CHANNELS_MAX;
use crate::channel_model::component::Quantity;
use crate::channel_model::fault_kind::{DRIVE_KINDS, FaultKind, SHARE_SD};
use crate::channel_model::law::{BLOCKS, Row};
use crate::channel_model::window::OFFSET;

impl Bank {
    pub(super) fn weigh_drive(&mut self, drive: usize) {
        let DrivePlace { component, wheel } = self.drives[drive];
        for (k, kind) in DRIVE_KINDS.into_iter().enumerate() {
            self.weighed[component][k] = self.drive(drive, wheel, kind);
        }
    }

    fn drive(&self, drive: usize, wheel: Option<usize>, kind: FaultKind) -> Weighed {
        let is_own = |i: usize| wheel.is_some() && self.channels[i].target.wheel == wheel;
        let own_rate =
            |i: usize| is_own(i) && self.channels[i].target.quantity == Quantity::WheelRate;
        match kind {
            FaultKind::Stuck => self.stuck(drive, wheel),
            FaultKind::Loss => self.moved(&self.window.share[drive], -1.0, |_| true),
            // Where nothing tells the wheel's rate, this is the same as a loss.
            FaultKind::Slip if !(0..self.channels.len()).any(own_rate) => Weighed::NONE,
            FaultKind::Slip => self.moved(&self.window.share[drive], -1.0, |i| !own_rate(i)),
            FaultKind::Offset => {
                let found = self.moved(&self.window.offset[drive], 1.0, |_| true);
                Weighed {
                    size: OFFSET * found.size,
                    size_sd: OFFSET * found.size_sd,
                    ..found
                }
            }
            FaultKind::Rough if (0..self.channels.len()).any(is_own) => self.noisier(is_own),
            _ => Weighed::NONE,
        }
    }

    /// A drive that stands still: what it moves lacks its whole part, and its motor's current says
    /// nothing.
    fn stuck(&self, drive: usize, wheel: Option<usize>) -> Weighed {
        let n = self.channels.len();
        let share = &self.window.share[drive];
        let of_motor = |i: &usize| {
            let target = &self.channels[*i].target;
            wheel.is_some() && target.wheel == wheel && target.quantity == Quantity::Current
        };
        let silent = (0..n).find(of_motor);
        let (free, price) = silent.map_or((0.0, 0.0), |silent| {
            let (less, _) = self.law().deviation(silent, 0);
            let less = less * (1.0 - 1.0 / (ERRATIC * ERRATIC));
            (less, self.law().blocks(0) as f64 * ERRATIC.ln())
        });
        let mut rows = [[0.0; BLOCKS]; CHANNELS_MAX];
        for i in (0..n).filter(|i| Some(*i) != silent) {
            rows[i] = share[i].map(|value| -value);
        }
        let changes = self.law().joint_change(&rows[..n], silent);
        Weighed::over(DRIVE_ONSETS.map(|first| Weighed {
            log_ratio: self.law().log_ratio(free + changes[first].less(), price),
            age_s: self.window.block_s() * self.law().blocks(first) as f64,
            ..Weighed::NONE
        }))
    }

    /// A change of several channels.
    fn moved(&self, signature: &[Row], sign: f64, shows: impl Fn(usize) -> bool) -> Weighed {
        let n = self.channels.len();
        let mut rows = [[0.0; BLOCKS]; CHANNELS_MAX];
        for i in (0..n).filter(|&i| shows(i)) {
            rows[i] = signature[i].map(|value| sign * value);
        }
        let changes = self.law().joint_change(&rows[..n], None);
        Weighed::over(DRIVE_ONSETS.map(|first| self.sized(changes[first], SHARE_SD, first)))
    }
}
