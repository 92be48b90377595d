//! Whether an identifier has seen how what stands began.

use vigil_checkpoint::CheckpointValue;

/// Motion, s, after which an identifier that began beside an alarm knows as much as another one.
/// Chosen: as much as it keeps by default; a robot waits for it in doubt.
const ENOUGH_S: f64 = 3.0;

/// Motion without an alarm, s, before which a fault that shows may be older than the identifier.
/// Chosen: longer than a new detector takes to arm and to raise an alarm beside a stuck wheel that
/// is steered against.
const QUIET_S: f64 = 6.0;

/// How much motion an identifier has seen, and whether an alarm stood before that.
#[derive(Debug, Clone, Copy, Default, CheckpointValue)]
pub struct OnsetSight {
    has_begun: bool,
    is_late: bool,
    moved_s: f64,
    /// An alarm stands, and motion while none did.
    stands: bool,
    quiet_s: f64,
}

impl OnsetSight {
    /// So much more motion was seen.
    pub fn pass(&mut self, moved_s: f64) {
        self.moved_s += moved_s;
        if !self.stands {
            self.quiet_s += moved_s;
        }
    }

    /// Takes whether an alarm stands.
    pub const fn take(&mut self, stands: bool) {
        self.is_late = stands && (self.is_late || !self.has_begun);
        (self.has_begun, self.stands) = (true, stands);
    }

    /// True once the robot has moved long enough without an alarm to have been whole.
    #[must_use]
    pub fn has_seen_quiet(&self) -> bool {
        self.quiet_s >= QUIET_S
    }

    /// True while an alarm stands that was there before the identifier, which has seen little
    /// motion since it began.
    #[must_use]
    pub fn is_short(&self) -> bool {
        self.is_late && self.moved_s < ENOUGH_S
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn who_begins_beside_an_alarm_is_short_of_sight_until_enough_is_seen() {
        let mut sight = OnsetSight::default();
        assert!(!sight.is_short());
        sight.take(true);
        sight.pass(2.5);
        sight.take(true);
        assert!(sight.is_short());
        sight.pass(0.5);
        assert!(!sight.is_short());
    }

    #[test]
    fn motion_beside_an_alarm_shows_no_whole_robot() {
        let mut sight = OnsetSight::default();
        for (stands, moved_s, is_quiet) in [
            (true, 9.0, false),
            (false, 5.9, false),
            (true, 9.0, false),
            (false, 0.2, true),
            (true, 1.0, true),
        ] {
            sight.take(stands);
            sight.pass(moved_s);
            assert_eq!(sight.has_seen_quiet(), is_quiet, "{moved_s}");
        }
    }

    #[test]
    fn who_has_seen_the_alarm_rise_or_fall_is_not() {
        let mut sight = OnsetSight::default();
        sight.take(false);
        sight.take(true);
        assert!(!sight.is_short());
        sight = OnsetSight::default();
        sight.take(true);
        sight.take(false);
        assert!(!sight.is_short());
        sight.take(true);
        assert!(!sight.is_short());
    }
}
