//! The channels in which a fault is suspected.

use vigil_blocks::{CHANNELS, Channel, WHEELS};

/// While an alarm stands, the channels that more likely show a fault than not: what they read is no
/// property of a healthy robot. None without an alarm.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Suspects(u64);

const _: () = assert!(CHANNELS <= u64::BITS as usize);

impl Suspects {
    /// Those of these natural log-odds by channel; see [`Channel`].
    #[must_use]
    pub fn new(alarm: bool, log_odds: &[f64; CHANNELS]) -> Self {
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
    pub fn has_wheel_rate(self) -> bool {
        (0..WHEELS).any(|wheel| self.has(Channel::wheel_rate(wheel)))
    }

    /// True if one is in a motor's current.
    #[must_use]
    pub fn has_current(self) -> bool {
        (0..WHEELS).any(|wheel| self.has(Channel::current(wheel)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn while_an_alarm_stands_channels_with_positive_odds_are_suspected_and_no_others() {
        let mut log_odds = [f64::NEG_INFINITY; CHANNELS];
        (log_odds[Channel::POSE], log_odds[Channel::wheel_rate(2)]) = (0.0, 0.1);
        assert_eq!(Suspects::new(false, &log_odds), Suspects::default());
        let suspects = Suspects::new(true, &log_odds);
        assert!(suspects.has_wheel_rate() && !suspects.has_current());
        let all: Vec<usize> = (0..CHANNELS).filter(|&c| suspects.has(c)).collect();
        assert_eq!(all, [Channel::wheel_rate(2)]);
    }
}
