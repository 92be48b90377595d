//! Declared faults: by the channels in which each shows, and by its labelled runs.

use super::{Bank, JOINT_ONSETS, Weighed};
use crate::channel_model::fault_kind::{DECLARED_KINDS, FaultKind};
use crate::channel_model::law::BLOCKS;
use crate::channel_model::shift::Shift;

impl Bank {
    pub(super) fn weigh_declared(&mut self, fault: usize) {
        let component = self.first_declared + fault;
        for (k, kind) in DECLARED_KINDS.into_iter().enumerate() {
            self.weighed[component][k] = match kind {
                FaultKind::Shift => self.shifted(fault),
                FaultKind::Signature if !self.declared.is_turning(fault) => self.recognized(fault),
                FaultKind::Turning if self.declared.is_turning(fault) => self.recognized(fault),
                _ => Weighed::NONE,
            };
        }
    }

    /// A declared fault by its labelled runs.
    fn recognized(&self, fault: usize) -> Weighed {
        // No evidence says nothing of a fault, and is no rare event.
        let found = self.declared.evidence(fault).filter(|found| *found > 0.0);
        found.map_or(Weighed::NONE, |log_ratio| Weighed {
            log_ratio,
            age_s: self.window.block_s() * BLOCKS as f64,
            ..Weighed::NONE
        })
    }

    /// A declared fault by the channels in which it shows.
    fn shifted(&self, fault: usize) -> Weighed {
        let Some(shift) = self.declared.shift(fault, self.first) else {
            return Weighed::NONE;
        };
        let unit = |channel: usize| (self.window.unit[channel], self.bias_sd[channel]);
        let law = self.law();
        let mut shifts = [Shift::default(); BLOCKS];
        for first in JOINT_ONSETS {
            shifts[first] = shift.weigh(law, first, unit);
        }
        let density = |first: usize| (-shifts[first].penalty).exp();
        self.begun(JOINT_ONSETS, |first| shifts[first].less, density)
            .0
    }
}
