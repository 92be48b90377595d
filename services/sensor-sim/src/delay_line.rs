//! Past readings, for sensors that report late.

use vigil_robot::disturbance_kind::DELAY_MAX_S;

/// Tolerance of a reading's age, s: far below any cycle.
const ROUNDING_S: f64 = 1e-9;

/// Readings of the last [`DELAY_MAX_S`], each of `N` numbers; nothing is allocated after the start.
#[derive(Debug, Clone)]
pub(crate) struct DelayLine<const N: usize> {
    readings: Vec<TimedReading<N>>,
    newest: usize,
}

/// A reading and its instant.
#[derive(Debug, Clone, Copy)]
struct TimedReading<const N: usize> {
    t_s: f64,
    values: [f64; N],
}

impl<const N: usize> DelayLine<N> {
    /// For `rate_hz` readings a second.
    pub(crate) fn new(rate_hz: f64) -> Self {
        let capacity = (DELAY_MAX_S * rate_hz).ceil() as usize + 2;
        let none = TimedReading {
            t_s: f64::NEG_INFINITY,
            values: [0.0; N],
        };
        Self {
            readings: vec![none; capacity],
            newest: 0,
        }
    }

    /// Keeps the reading of instant `t_s`, which is not before the last one.
    pub(crate) fn push(&mut self, t_s: f64, values: [f64; N]) {
        assert!(
            t_s >= self.readings[self.newest].t_s,
            "readings come in the order of their times"
        );
        self.newest = (self.newest + 1) % self.readings.len();
        self.readings[self.newest] = TimedReading { t_s, values };
    }

    /// The newest reading that is at least `delay_s` old at `t_s`; the oldest kept if there is
    /// none.
    pub(crate) fn delayed(&self, t_s: f64, delay_s: f64) -> [f64; N] {
        let capacity = self.readings.len();
        let mut found = self.readings[self.newest].values;
        for back in 0..capacity {
            let reading = self.readings[(self.newest + capacity - back) % capacity];
            if reading.t_s == f64::NEG_INFINITY {
                break;
            }
            found = reading.values;
            if t_s - reading.t_s >= delay_s - ROUNDING_S {
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
        let mut line = DelayLine::<1>::new(20.0);
        for k in 0..200 {
            let t_s = f64::from(k) * 0.05;
            line.push(t_s, [f64::from(k)]);
            for (delay_s, steps) in [(0.0, 0), (0.3, 6), (0.31, 7), (2.0, 40)] {
                assert_eq!(line.delayed(t_s, delay_s), [f64::from((k - steps).max(0))]);
            }
        }
    }

    #[test]
    #[should_panic(expected = "readings come in the order of their times")]
    fn a_reading_from_the_past_would_end_the_process() {
        let mut line = DelayLine::<1>::new(20.0);
        line.push(1.0, [0.0]);
        line.push(0.95, [0.0]);
    }
}
