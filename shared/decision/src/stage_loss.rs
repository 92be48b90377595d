//! Which stages are lost: nothing has come from them for several cycles.

use vigil_checkpoint::Checkpoint;

/// Misses in a row after which a stage counts as lost. As for every input of a service
/// (`vigil_cycle`): one late cycle is the machine's, three in a row are the stage's.
const LOST_AFTER_MISSES: u32 = 3;
/// Bit of `Action::lost_stages`: the identifier is lost.
const IDENTIFIER_LOST: u32 = 1;
/// Bit of `Action::lost_stages`: the detector is lost.
const DETECTOR_LOST: u32 = 2;

/// Counts misses in a row.
#[derive(Debug, Clone, Checkpoint)]
pub(crate) struct StageLossMonitor {
    misses: u32,
    misses_without_detection: u32,
    #[checkpoint(fixed)]
    blind_after_misses: u32,
}

impl StageLossMonitor {
    /// After `blind_after_misses` misses in a row without any stage, no belief is usable.
    pub(crate) const fn new(blind_after_misses: u32) -> Self {
        Self {
            misses: 0,
            misses_without_detection: 0,
            blind_after_misses,
        }
    }

    /// More misses of both stages; true if no belief is usable any more.
    pub(crate) const fn miss(&mut self, count: u32) -> bool {
        self.misses = self.misses.saturating_add(count);
        self.misses_without_detection = self.misses_without_detection.saturating_add(count);
        self.misses_without_detection >= self.blind_after_misses
    }

    /// A detection has come.
    pub(crate) const fn detection(&mut self) {
        self.misses_without_detection = 0;
    }

    /// A diagnosis has come without a detection; true if none has come for so long that symptoms
    /// are unknown and no belief in exceptions is usable.
    pub(crate) const fn no_detection(&mut self) -> bool {
        self.misses_without_detection = self.misses_without_detection.saturating_add(1);
        self.misses_without_detection >= self.blind_after_misses
    }

    /// A diagnosis has come that makes up for a missing detection.
    pub(crate) const fn diagnosis(&mut self) {
        self.misses_without_detection = 0;
        self.diagnosis_alone();
    }

    /// A diagnosis has come, which holds no symptoms.
    pub(crate) const fn diagnosis_alone(&mut self) {
        self.misses = 0;
    }

    pub(crate) const fn identifier_is_lost(&self) -> bool {
        self.misses >= LOST_AFTER_MISSES
    }

    /// As [`vigil_blocks::Action::lost_stages`].
    pub(crate) fn lost_stages(&self) -> u32 {
        let detector = self.misses_without_detection >= LOST_AFTER_MISSES;
        u32::from(self.identifier_is_lost()) * IDENTIFIER_LOST + u32::from(detector) * DETECTOR_LOST
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_stage_is_lost_after_three_misses_and_blindness_comes_at_its_own_count() {
        let mut losses = StageLossMonitor::new(5);
        assert!(!losses.miss(2));
        assert_eq!(
            (losses.lost_stages(), losses.identifier_is_lost()),
            (0, false)
        );
        assert!(!losses.miss(1));
        assert_eq!(
            (losses.lost_stages(), losses.identifier_is_lost()),
            (3, true)
        );
        assert!(!losses.miss(1));
        assert!(losses.miss(1));
        assert!(losses.miss(u32::MAX), "counts do not wrap");
    }

    #[test]
    fn each_stage_clears_what_it_makes_up_for() {
        let lost = || {
            let mut losses = StageLossMonitor::new(5);
            losses.miss(4);
            losses
        };
        let mut detected = lost();
        detected.detection();
        assert_eq!(detected.lost_stages(), 1);
        let mut diagnosed = lost();
        diagnosed.diagnosis();
        assert_eq!(diagnosed.lost_stages(), 0);
        diagnosed.diagnosis();
        let mut alone = lost();
        assert!(alone.identifier_is_lost());
        alone.diagnosis_alone();
        assert_eq!(alone.lost_stages(), 2);
        assert!(!alone.identifier_is_lost());
        assert!(alone.no_detection(), "the fifth in a row");
        alone.detection();
        assert!((0..4).all(|_| !alone.no_detection()));
        assert!(alone.no_detection());
        assert_eq!(alone.lost_stages(), 2);
    }
}
