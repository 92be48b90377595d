//! Faults of drives: what each changes in all channels at once.

use super::{Bank, DRIVE_ONSETS, DrivePlace, ERRATIC, Weighed};
use crate::channel_model::component::Quantity;
use crate::channel_model::fault_kind::{DRIVE_KINDS, FaultKind, SHARE_SD};
use crate::channel_model::law::{BLOCKS, Change, JointSignature};
use crate::channel_model::window::OFFSET;

/// What drives do that move the robot in the same way.
struct Moved {
    /// Their part of all channels, and what the window says of it.
    share: JointSignature,
    of_share: [Change; BLOCKS],
    loss: Weighed,
    offset: Weighed,
}

impl Bank {
    pub(super) fn weigh_drives(&mut self) {
        for group in 0..self.window.groups() {
            let moved = self.moved(group);
            for drive in 0..self.drives.len() {
                if self.window.group(drive) == group {
                    self.weigh_drive(self.drives[drive], &moved);
                }
            }
        }
    }

    fn moved(&self, group: usize) -> Moved {
        let (law, n) = (self.law(), self.channels.len());
        let share = law.signature(&self.window.share[group][..n]);
        let of_share = law.joint_change(&share, None);
        let offset = law.signature(&self.window.offset[group][..n]);
        let offset = self.sized(DRIVE_ONSETS, &law.joint_change(&offset, None), SHARE_SD);
        Moved {
            share,
            of_share,
            loss: self.lost(&of_share),
            offset: Weighed {
                size: OFFSET * offset.size,
                size_sd: OFFSET * offset.size_sd,
                ..offset
            },
        }
    }

    fn weigh_drive(&mut self, DrivePlace { component, wheel }: DrivePlace, moved: &Moved) {
        let channels = || self.channels.iter().enumerate();
        let of_wheel = |i: usize| wheel.is_some() && self.channels[i].target.wheel == wheel;
        let own = |quantity: Quantity| {
            let mut own =
                channels().filter(|(i, one)| of_wheel(*i) && one.target.quantity == quantity);
            own.next().map(|(i, _)| i)
        };
        let found = DRIVE_KINDS.map(|kind| match kind {
            FaultKind::Stuck => self.stuck(moved, own(Quantity::Current)),
            FaultKind::Loss => moved.loss,
            // Where nothing tells the wheel's rate, this is the same as a loss.
            FaultKind::Slip => own(Quantity::WheelRate).map_or(Weighed::NONE, |rate| {
                self.lost(&self.law().joint_change(&moved.share, Some(rate)))
            }),
            FaultKind::Offset => moved.offset,
            FaultKind::Rough if channels().any(|(i, _)| of_wheel(i)) => self.noisier(of_wheel),
            _ => Weighed::NONE,
        });
        self.weighed[component][..found.len()].copy_from_slice(&found);
    }

    /// A drive that stands still: what it moves lacks its whole part, and its motor's current says
    /// nothing.
    fn stuck(&self, moved: &Moved, current: Option<usize>) -> Weighed {
        let law = self.law();
        let (mut changes, mut free, mut price) = (moved.of_share, 0.0, 0.0);
        if let Some(current) = current {
            law.silence(&mut changes, &moved.share, current);
            free = law.silenced(current)[0] * (1.0 - 1.0 / (ERRATIC * ERRATIC));
            price = law.blocks(0) as f64 * ERRATIC.ln();
        }
        let less = |first: usize| free - 2.0 * changes[first].b - changes[first].a;
        let (found, _) = self.begun(DRIVE_ONSETS, less, |_| 1.0);
        Weighed {
            log_ratio: found.log_ratio - price,
            ..found
        }
    }

    /// A part of a share that is lost.
    fn lost(&self, of_share: &[Change; BLOCKS]) -> Weighed {
        let found = self.sized(DRIVE_ONSETS, of_share, SHARE_SD);
        Weighed {
            size: -found.size,
            ..found
        }
    }
}
