//! The faults that a description declares, weighed over the last few seconds.

use super::component::Target;
use super::law::{BLOCKS, Law};
use super::shift::ShiftLaw;
use super::signature::{Evidence, Signature, Signatures, means};
use super::window::Window;
use crate::description::Description;

/// One fault at work.
#[derive(Debug, Clone)]
struct Declared {
    /// Shifts of the channels in which it is declared to show, for windows that begin with each
    /// block; empty if none are declared, or one of them is not in use.
    shifts: Vec<ShiftLaw>,
    /// How it showed in labelled runs.
    signature: Option<Signature>,
    evidence: Evidence,
}

/// All of a robot's.
#[derive(Debug, Clone)]
pub struct DeclaredFaults {
    all: Vec<Declared>,
    signatures: Signatures,
    channels: usize,
}

impl DeclaredFaults {
    /// Those of `robot` over the channels in use, whose law is that of windows that begin with each
    /// block. Signatures need all channels.
    #[must_use]
    pub fn new(
        robot: &Description,
        used: &[Target],
        laws: &[Law],
        signatures: Option<&Signatures>,
    ) -> Self {
        let signatures = signatures.cloned().unwrap_or_default();
        let place = |name: &String| used.iter().position(|target| target.name == *name);
        let declared = robot.fault.iter().map(|fault| {
            let shown: Option<Vec<usize>> = fault.shows.iter().map(place).collect();
            let shown = shown.filter(|shown| !shown.is_empty());
            let shifts =
                shown.map(|shown| laws.iter().map(|law| ShiftLaw::new(law, &shown)).collect());
            let mut learned = signatures.fault.iter();
            Declared {
                shifts: shifts.unwrap_or_default(),
                signature: learned.find(|one| one.fault == fault.name).cloned(),
                evidence: Evidence::default(),
            }
        });
        Self {
            all: declared.collect(),
            signatures,
            channels: used.len(),
        }
    }

    /// How many there are.
    #[must_use]
    pub const fn len(&self) -> usize {
        self.all.len()
    }

    /// True if there are none.
    #[must_use]
    pub const fn is_empty(&self) -> bool {
        self.all.is_empty()
    }

    /// True if something can show it.
    #[must_use]
    pub fn is_seen(&self, fault: usize) -> bool {
        let declared = &self.all[fault];
        declared.signature.is_some() || !declared.shifts.is_empty()
    }

    /// Forgets the record.
    pub fn clear(&mut self) {
        for declared in &mut self.all {
            declared.evidence = Evidence::default();
        }
    }

    /// Takes the signatures' part of a window, which is `dt_s` newer than the last one.
    pub fn take(&mut self, window: &Window, dt_s: f64) {
        if self.signatures.is_empty() || window.whole_blocks() < BLOCKS {
            return;
        }
        let found = self.signatures.standardized(&means(window, self.channels));
        for declared in &mut self.all {
            if let Some(signature) = &declared.signature {
                declared.evidence.take(signature.log_ratio(&found), dt_s);
            }
        }
    }

    /// Evidence of a fault's signature, nats; none if it has none.
    #[must_use]
    pub fn evidence(&self, fault: usize) -> Option<f64> {
        let declared = &self.all[fault];
        let signature = declared.signature.as_ref();
        signature.map(|_| declared.evidence.log_ratio())
    }

    /// The law of a shift of a fault's channels in windows whose whole blocks begin with `begin`;
    /// none if no channels are declared.
    #[must_use]
    pub fn shift(&self, fault: usize, begin: usize) -> Option<&ShiftLaw> {
        let shifts = &self.all[fault].shifts;
        shifts.get(begin).or_else(|| shifts.last())
    }
}
