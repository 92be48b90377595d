//! The period of a sensor's frames, from the times at which they were captured.

/// Intervals remembered. Chosen: the low third, ten of them, holds the period whatever befalls the
/// others.
const MEMORY: usize = 31;
/// Intervals after which one is judged by the others, and the part of the period below which it is
/// none. The low quantile then stands on its third smallest.
const KNOWN: usize = 8;
/// A frame sent twice follows at once; no jitter is four fifths of a period.
const DOUBLE: f64 = 0.2;

/// A low quantile of the last intervals between frames. Frames that are lost, late or come in
/// bursts do not change it while a third comes in time: the noise of a sample belongs to the
/// sensor, not to the gap before it. What jitter makes of it is too short a period, of samples
/// believed to be noisier than they are, which the estimate of the noise puts right.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
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
