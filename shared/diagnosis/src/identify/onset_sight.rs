//! Whether an identifier has seen how what stands began.

use vigil_checkpoint::CheckpointValue;

/// Who has watched for less than this before an alarm has begun beside it, s. Chosen: no detector
/// that began at the same time has armed by then.
const EARLIEST_ALARM_S: f64 = 1.0;
/// Motion, s, after which an identifier that began beside an alarm knows as much as another one.
/// Chosen: as much as it keeps by default; a robot waits for it in doubt.
const ENOUGH_S: f64 = 3.0;

/// For how long an identifier has watched the robot, and whether an alarm stood before that.
#[derive(Debug, Clone, Copy, Default, CheckpointValue)]
pub struct OnsetSight {
    watched_s: f64,
    /// Motion in that time: a robot at rest shows nothing.
    moved_s: f64,
    stands: bool,
    is_late: bool,
}

impl OnsetSight {
    /// So much time was watched, with so much motion in it.
    pub fn pass(&mut self, watched_s: f64, moved_s: f64) {
        self.watched_s += watched_s;
        self.moved_s += moved_s;
    }

    /// Takes whether an alarm stands.
    pub fn take(&mut self, stands: bool) {
        if stands != self.stands {
            self.is_late = stands && self.watched_s < EARLIEST_ALARM_S;
        }
        self.stands = stands;
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
        assert!(sight.is_short());
        sight.pass(9.0, 2.5);
        sight.take(true);
        assert!(sight.is_short());
        sight.pass(0.5, 0.5);
        assert!(!sight.is_short());
        sight.take(false);
        sight.take(true);
        assert!(!sight.is_short(), "it has seen the second one begin");
    }

    #[test]
    fn who_has_watched_a_second_before_the_alarm_is_not() {
        let mut sight = OnsetSight::default();
        sight.pass(0.5, 0.0);
        sight.take(false);
        sight.pass(0.5, 0.0);
        sight.take(true);
        assert!(!sight.is_short());
        sight = OnsetSight::default();
        sight.pass(0.9, 0.9);
        sight.take(true);
        assert!(sight.is_short());
        sight.take(false);
        assert!(!sight.is_short(), "it has fallen");
    }
}
