//! Stages that are not heard.

/// Diagnoses missed in a row after which a stage counts as lost: as a service's input does.
const LOST_AFTER_MISSES: u32 = 3;
/// Bit of `Action::lost_stages`: the identifier is lost.
const IDENTIFIER_LOST: u32 = 1;
/// Bit of `Action::lost_stages`: the detector is lost.
const DETECTOR_LOST: u32 = 2;

/// Counts misses.
#[derive(Debug, Clone)]
pub(crate) struct Silence {
    misses: u32,
    misses_without_detection: u32,
    blind_after_misses: u32,
}

impl Silence {
    /// Without any stage for `blind_after_misses` misses in a row, no belief is usable.
    pub(crate) const fn new(blind_after_misses: u32) -> Self {
        Self {
            misses: 0,
            misses_without_detection: 0,
            blind_after_misses,
        }
    }

    /// More misses; true if no belief is usable any more.
    pub(crate) const fn miss(&mut self, count: u32) -> bool {
        self.misses = self.misses.saturating_add(count);
        self.misses_without_detection = self.misses_without_detection.saturating_add(count);
        self.misses_without_detection >= self.blind_after_misses
    }

    /// The detector is heard.
    pub(crate) const fn detection(&mut self) {
        self.misses_without_detection = 0;
    }

    /// The detector is not heard with a diagnosis; true if no word of symptoms has come for so long
    /// that no belief in exceptions is usable any more.
    pub(crate) const fn no_detection(&mut self) -> bool {
        self.misses_without_detection = self.misses_without_detection.saturating_add(1);
        self.misses_without_detection >= self.blind_after_misses
    }

    /// The identifier is heard; true if it was lost.
    pub(crate) const fn diagnosis(&mut self) -> bool {
        let was_lost = self.identifier_is_lost();
        (self.misses, self.misses_without_detection) = (0, 0);
        was_lost
    }

    /// The identifier alone is heard: no word of symptoms. True if it was lost.
    pub(crate) const fn identifier_heard(&mut self) -> bool {
        let was_lost = self.identifier_is_lost();
        self.misses = 0;
        was_lost
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
