//! Log-odds of a fault by channel, after and before the last observation.

use vigil_inference::logspace::log_add;

use crate::slot::SLOTS;

/// Sums over all tests of a channel ([`crate::slot::Slot`]): a fault shows in one of them.
#[derive(Debug, Clone, Copy)]
pub(crate) struct ChannelOdds {
    now: [f64; SLOTS],
    before: [f64; SLOTS],
}

impl ChannelOdds {
    /// No test shows a fault.
    pub(crate) const fn none() -> Self {
        Self {
            now: [f64::NEG_INFINITY; SLOTS],
            before: [f64::NEG_INFINITY; SLOTS],
        }
    }

    /// Adds a test's log-odds to a channel.
    pub(crate) fn enter(&mut self, channel: usize, now: f64, before: f64) {
        self.now[channel] = log_add(self.now[channel], now);
        self.before[channel] = log_add(self.before[channel], before);
    }

    /// Log-odds by channel.
    pub(crate) const fn by_channel(&self) -> [f64; SLOTS] {
        self.now
    }

    /// Evidence of the observation in each channel, for a fault that was there before and after.
    pub(crate) fn gains(&self) -> [f64; SLOTS] {
        std::array::from_fn(|channel| finite(self.now[channel] - self.before[channel]))
    }
}

/// A gain; 0 where no test shows a fault.
const fn finite(gain: f64) -> f64 {
    if gain.is_finite() { gain } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_gain_is_of_its_channel_and_none_where_nothing_shows() {
        let mut odds = ChannelOdds::none();
        assert_eq!(odds.gains(), [0.0; SLOTS]);
        odds.enter(3, 2.0, 1.0);
        odds.enter(5, -1.0, -0.5);
        let gains = odds.gains();
        assert!((gains[3] - 1.0).abs() < 1e-12 && (gains[5] + 0.5).abs() < 1e-12);
        assert_eq!(gains[0], 0.0);
    }
}
