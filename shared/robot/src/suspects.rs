//! Channels in which a fault is suspected.

use vigil_blocks::WHEELS;
use vigil_checkpoint::CheckpointValue;

use crate::slot::{SLOTS, Slot};

/// While an alarm stands, the channels that show a fault with odds above even. Nothing is learned
/// from them: their measurements are not those of a healthy robot. Empty without an alarm.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, CheckpointValue)]
pub struct Suspects(u64);

const _: () = assert!(SLOTS <= u64::BITS as usize);

impl Suspects {
    /// The channels with positive log-odds; their order is that of [`Slot`].
    #[must_use]
    pub fn new(alarm: bool, log_odds: &[f64; SLOTS]) -> Self {
        let all = log_odds.iter().enumerate();
        let suspected = all.filter(|(_, odds)| alarm && **odds > 0.0);
        Self(suspected.fold(0, |bits, (channel, _)| bits | 1 << channel))
    }

    /// True if a fault is suspected in this channel.
    #[must_use]
    pub const fn has(self, channel: usize) -> bool {
        self.0 >> channel & 1 == 1
    }

    /// True if one is in a wheel's rate.
    #[must_use]
    pub(crate) fn has_wheel_rate(self) -> bool {
        (0..WHEELS).any(|wheel| self.has(Slot::wheel_rate(wheel)))
    }

    /// True if one is in a motor's current.
    #[must_use]
    pub fn has_current(self) -> bool {
        (0..WHEELS).any(|wheel| self.has(Slot::current(wheel)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn while_an_alarm_stands_channels_with_positive_odds_are_suspected_and_no_others() {
        let mut log_odds = [f64::NEG_INFINITY; SLOTS];
        (log_odds[Slot::POSE], log_odds[Slot::wheel_rate(2)]) = (0.0, 0.1);
        assert_eq!(Suspects::new(false, &log_odds), Suspects::default());
        let suspects = Suspects::new(true, &log_odds);
        assert!(suspects.has_wheel_rate() && !suspects.has_current());
        let all: Vec<usize> = (0..SLOTS).filter(|&c| suspects.has(c)).collect();
        assert_eq!(all, [Slot::wheel_rate(2)]);
    }

    #[test]
    fn the_last_wheel_and_its_current_are_suspected_apart() {
        for (channel, rate, current) in [
            (Slot::wheel_rate(WHEELS - 1), true, false),
            (Slot::current(WHEELS - 1), false, true),
            (Slot::current(0), false, true),
            (Slot::steer(0), false, false),
        ] {
            let mut log_odds = [-1.0; SLOTS];
            log_odds[channel] = 1e-9;
            let suspects = Suspects::new(true, &log_odds);
            let found = (suspects.has_wheel_rate(), suspects.has_current());
            assert_eq!(found, (rate, current), "{channel}");
        }
    }
}
