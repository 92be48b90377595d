//! Faults of drives: what each changes in all channels at once.

use super::{Bank, DRIVE_ONSETS, DrivePlace, ERRATIC, Weighed};
use crate::channel_model::component::Quantity;
use crate::channel_model::fault_kind::{DRIVE_KINDS, FaultKind, SHARE_SD};
use crate::channel_model::law::JointSignature;
use crate::channel_model::window::OFFSET;

impl Bank {
    pub(super) fn weigh_drive(&mut self, drive: usize) {
        let DrivePlace { component, wheel } = self.drives[drive];
        let (law, n) = (self.law(), self.channels.len());
        let share = law.signature(&self.window.share[drive][..n]);
        let found = DRIVE_KINDS.map(|kind| self.drive(drive, wheel, kind, &share));
        self.weighed[component][..found.len()].copy_from_slice(&found);
    }

    fn drive(
        &self,
        drive: usize,
        wheel: Option<usize>,
        kind: FaultKind,
        share: &JointSignature,
    ) -> Weighed {
        let n = self.channels.len();
        let of_wheel = |i: usize| wheel.is_some() && self.channels[i].target.wheel == wheel;
        let own = |quantity: Quantity| {
            (0..n).find(|&i| of_wheel(i) && self.channels[i].target.quantity == quantity)
        };
        let law = self.law();
        match kind {
            FaultKind::Stuck => self.stuck(share, own(Quantity::Current)),
            FaultKind::Loss => self.lost(share, None),
            // Where nothing tells the wheel's rate, this is the same as a loss.
            FaultKind::Slip => {
                own(Quantity::WheelRate).map_or(Weighed::NONE, |rate| self.lost(share, Some(rate)))
            }
            FaultKind::Offset => {
                let offset = law.signature(&self.window.offset[drive][..n]);
                let found = self.moved(&offset, None);
                Weighed {
                    size: OFFSET * found.size,
                    size_sd: OFFSET * found.size_sd,
                    ..found
                }
            }
            FaultKind::Rough if (0..n).any(of_wheel) => self.noisier(of_wheel),
            _ => Weighed::NONE,
        }
    }

    /// A drive that stands still: what it moves lacks its whole part, and its motor's current says
    /// nothing.
    fn stuck(&self, share: &JointSignature, current: Option<usize>) -> Weighed {
        let law = self.law();
        let (free, price) = current.map_or((0.0, 0.0), |current| {
            let less = law.silenced(current)[0] * (1.0 - 1.0 / (ERRATIC * ERRATIC));
            (less, law.blocks(0) as f64 * ERRATIC.ln())
        });
        let changes = match current {
            Some(current) => law.joint_change_beside(share, current),
            None => law.joint_change(share, None),
        };
        let less = |first: usize| free - 2.0 * changes[first].b - changes[first].a;
        let (found, _) = self.begun(DRIVE_ONSETS, less, |_| 1.0);
        Weighed {
            log_ratio: found.log_ratio - price,
            ..found
        }
    }

    /// A part of a share that is lost, but for one channel.
    fn lost(&self, share: &JointSignature, but: Option<usize>) -> Weighed {
        let found = self.moved(share, but);
        Weighed {
            size: -found.size,
            ..found
        }
    }

    /// A change of several channels, but for one.
    fn moved(&self, signature: &JointSignature, but: Option<usize>) -> Weighed {
        let changes = self.law().joint_change(signature, but);
        self.sized(DRIVE_ONSETS, &changes, SHARE_SD)
    }
}
