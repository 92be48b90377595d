//! While the detector is blind, no diagnosis is made: its names say BLIND.

use vigil_blocks::{DetectionBelief, FaultBelief, MODE_BLIND};
use vigil_checkpoint::CheckpointValue;

/// Puts [`MODE_BLIND`] over the names that a filter reports. The probabilities stay the filter's.
#[derive(Debug, Clone, Copy, Default, CheckpointValue)]
pub(crate) struct BlindOverride {
    is_blind: bool,
    mode: u32,
    mode_changes: u32,
    reported: u32,
    reported_changes: u32,
}

impl BlindOverride {
    /// Takes whether the detector is blind.
    pub(crate) const fn look(&mut self, detection: &DetectionBelief) {
        self.is_blind = detection.blind != 0;
    }

    /// Covers the names, and counts the changes of what readers then see.
    pub(crate) const fn cover(&mut self, belief: &mut FaultBelief) {
        if self.is_blind {
            (belief.mode, belief.reported) = (MODE_BLIND, MODE_BLIND);
        }
        let changes = (self.mode != belief.mode) as u32;
        self.mode_changes = self.mode_changes.saturating_add(changes);
        let changes = (self.reported != belief.reported) as u32;
        self.reported_changes = self.reported_changes.saturating_add(changes);
        (self.mode, self.reported) = (belief.mode, belief.reported);
        belief.mode_change_count = self.mode_changes;
        belief.reported_change_count = self.reported_changes;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_diagnosis_is_covered_while_the_detector_is_blind_and_comes_back_as_it_was() {
        let mut cover = BlindOverride::default();
        let detection = |blind| DetectionBelief {
            blind,
            ..DetectionBelief::default()
        };
        let mut names = Vec::new();
        for blind in [0, 0, 3, 3, 0] {
            let mut belief = FaultBelief {
                mode: 7,
                reported: 7,
                ..FaultBelief::default()
            };
            belief.p[7] = 0.9;
            cover.look(&detection(blind));
            cover.cover(&mut belief);
            assert_eq!(belief.p[7].to_bits(), 0.9_f64.to_bits());
            assert_eq!(belief.mode, belief.reported);
            assert_eq!(belief.mode_change_count, belief.reported_change_count);
            names.push((belief.mode, belief.mode_change_count));
        }
        let expected = [(7, 1), (7, 1), (MODE_BLIND, 2), (MODE_BLIND, 2), (7, 3)];
        assert_eq!(names, expected);
    }
}
