//! Past readings, for sensors that are late.

use vigil_robot::disturbance::DELAY_MAX_S;

/// Tolerance of a reading's age, s: far below any cycle.
const ROUNDING_S: f64 = 1e-9;

/// Readings of the last [`DELAY_MAX_S`], each of `N` numbers; nothing is allocated after the start.
#[derive(Debug, Clone)]
pub(crate) struct History<const N: usize> {
    kept: Vec<(f64, [f64; N])>,
    newest: usize,
}

impl<const N: usize> History<N> {
    /// For `rate_hz` readings a second.
    pub(crate) fn new(rate_hz: f64) -> Self {
        let capacity = (DELAY_MAX_S * rate_hz).ceil() as usize + 2;
        Self {
            kept: vec![(f64::NEG_INFINITY, [0.0; N]); capacity],
            newest: 0,
        }
    }

    /// Keeps the reading of instant `t_s`; times do not go back.
    pub(crate) fn keep(&mut self, t_s: f64, reading: [f64; N]) {
        self.newest = (self.newest + 1) % self.kept.len();
        self.kept[self.newest] = (t_s, reading);
    }

    /// The newest reading that is at least `delay_s` old at `t_s`; the oldest kept if there is
    /// none.
    pub(crate) fn before(&self, t_s: f64, delay_s: f64) -> [f64; N] {
        let capacity = self.kept.len();
        let mut found = self.kept[self.newest].1;
        for back in 0..capacity {
            let (at_s, reading) = self.kept[(self.newest + capacity - back) % capacity];
            if at_s == f64::NEG_INFINITY {
                break;
            }
            found = reading;
            if t_s - at_s >= delay_s - ROUNDING_S {
                break;
            }
        }
        found
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_reading_comes_back_exactly_its_delay_later() {
        let mut history = History::<1>::new(20.0);
        for k in 0..200 {
            let t_s = f64::from(k) * 0.05;
            history.keep(t_s, [f64::from(k)]);
            for (delay_s, steps) in [(0.0, 0), (0.3, 6), (0.31, 7), (2.0, 40)] {
                assert_eq!(
                    history.before(t_s, delay_s),
                    [f64::from((k - steps).max(0))]
                );
            }
        }
    }
}
