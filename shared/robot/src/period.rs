//! The period of a sensor's frames, from their capture times.

use vigil_checkpoint::CheckpointValue;

/// Intervals remembered. Chosen: the low third stands on ten of them, so that lost frames and
/// bursts among the others do not move it; more remember an old rate for longer.
const MEMORY: usize = 31;
/// Intervals from which on a frame may count as sent twice. Chosen: the quantile is then the third
/// smallest, which two early doubles cannot be.
const KNOWN: usize = 8;
/// Share of the period below which an interval is a frame sent twice. Chosen: a double follows at
/// once, and no jitter takes four fifths of a period.
const DOUBLE: f64 = 0.2;

/// A low quantile of the last intervals between frames. Lost, late and bunched frames do not change
/// it while a third comes in time: the noise of a sample depends on the sensor, not on the gap
/// before it. Jitter makes the period too short and the samples seem noisier, which the estimate of
/// the noise corrects.
#[derive(Debug, Clone, Copy, PartialEq, Default, CheckpointValue)]
pub struct FramePeriod {
    recent_ns: [u64; MEMORY],
    count: usize,
    /// The quantile of those remembered.
    low_ns: u64,
    /// Frames in a row that seemed to be sent twice.
    doubles: usize,
}

impl FramePeriod {
    /// Takes the interval to the frame before, ns. One that is far too short is a frame sent twice,
    /// unless that goes on: then the period has changed.
    pub fn push(&mut self, interval_ns: u64) {
        let short_ns = DOUBLE * self.low_ns as f64;
        let is_double = self.count >= KNOWN && (interval_ns as f64) < short_ns;
        self.doubles = if is_double { self.doubles + 1 } else { 0 };
        if is_double && self.doubles < MEMORY {
            return;
        }
        self.recent_ns[self.count % MEMORY] = interval_ns;
        self.count += 1;
        let known = self.count.min(MEMORY);
        let mut recent = self.recent_ns;
        self.low_ns = *recent[..known].select_nth_unstable(known / 3).1;
    }

    /// The period, s; none before the first interval.
    #[must_use]
    pub fn period_s(&self) -> Option<f64> {
        (self.count > 0).then_some(self.low_ns as f64 * 1e-9)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn a_frame_sent_twice_is_one_and_another_rate_is_taken() {
        let mut period = FramePeriod::default();
        (0..20).for_each(|_| period.push(10_000_000));
        for _ in 0..100 {
            period.push(100_000);
            period.push(9_900_000);
        }
        assert_eq!(period.period_s(), Some(0.0099));
        (0..200).for_each(|_| period.push(1_000_000));
        assert_eq!(period.period_s(), Some(0.001));
    }

    #[test]
    fn the_period_is_the_low_third_of_the_intervals_known_so_far() {
        let mut period = FramePeriod::default();
        assert_eq!(period.period_s(), None);
        // Sorted: 10, 20, 30, 40; of n the one at n / 3.
        for (interval_ms, expected_ms) in [(30, 30.0), (10, 10.0), (20, 20.0), (40, 20.0)] {
            period.push(interval_ms * 1_000_000);
            let found_ms = period.period_s().unwrap_or(f64::NAN) * 1e3;
            assert!(
                (found_ms - expected_ms).abs() < 1e-9,
                "{interval_ms}: {found_ms}"
            );
        }
    }

    #[test]
    fn short_intervals_are_doubles_only_below_a_fifth_and_once_eight_are_known() {
        let filled = |count: usize| {
            let mut period = FramePeriod::default();
            (0..count).for_each(|_| period.push(10_000_000));
            period
        };
        let mut early = filled(4);
        (0..3).for_each(|_| early.push(1));
        assert_eq!(early.period_s(), Some(1e-9));
        // The ninth is a double: of 8 + 16 intervals the low third is a long one, of 9 + 16 not.
        let mut ninth = filled(8);
        ninth.push(1);
        (0..16).for_each(|_| ninth.push(20_000_000));
        assert_eq!(ninth.period_s(), Some(0.02));
        let mut known = filled(8);
        (0..30).for_each(|_| known.push(1_999_999));
        assert_eq!(known.period_s(), Some(0.01));
        let mut not_double = filled(8);
        (0..5).for_each(|_| not_double.push(2_000_000));
        assert_eq!(not_double.period_s(), Some(0.002));
    }

    proptest! {
        #[test]
        fn lost_frames_do_not_change_the_period(
            lost in prop::collection::vec(prop::bool::weighted(0.3), 400),
            gap in 1_u64..200,
        ) {
            let mut period = FramePeriod::default();
            let mut last = 0;
            let kept = (1_u64..).zip(&lost).filter(|(_, lost)| !**lost).map(|(k, _)| k);
            for k in kept {
                // One long gap besides.
                let at = if k > 200 { k + gap } else { k };
                period.push((at - last) * 10_000_000);
                last = at;
            }
            prop_assert_eq!(period.period_s(), Some(0.01));
        }
    }
}
