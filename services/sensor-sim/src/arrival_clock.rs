//! When a frame of a publisher with a clock of its own was due, by this machine's clock.

/// The publisher's clock may run slower than ours by this share.
const DRIFT_MAX: f64 = 5e-4;
/// A frame that seems to be held up by more than this, ns, tells that the clock runs otherwise.
const HELD_UP_MAX_NS: i128 = 1_000_000_000;

/// Places capture times of another clock on ours: by the shortest way that a frame ever took, so
/// that a frame held up on its way still counts from when it was due.
#[derive(Debug, Clone, Default)]
pub struct ArrivalClock {
    known: Option<Known>,
}

#[derive(Debug, Clone, Copy)]
struct Known {
    epoch: u64,
    t_capture_ns: u64,
    /// Our clock minus the publisher's, ns.
    offset_ns: i128,
}

impl ArrivalClock {
    /// When the frame of `epoch` captured at `t_capture_ns` of its clock, which arrived at
    /// `now_ns` of ours, was due on ours, ns: never later than it arrived.
    pub fn due_ns(&mut self, epoch: u64, t_capture_ns: u64, now_ns: u64) -> u64 {
        let seen_ns = i128::from(now_ns) - i128::from(t_capture_ns);
        let offset_ns = match self.known {
            Some(known) if known.epoch == epoch && known.t_capture_ns <= t_capture_ns => {
                let elapsed_ns = (t_capture_ns - known.t_capture_ns) as f64;
                let drifted_ns = known.offset_ns + (DRIFT_MAX * elapsed_ns).ceil() as i128;
                if seen_ns - drifted_ns > HELD_UP_MAX_NS {
                    seen_ns
                } else {
                    drifted_ns.min(seen_ns)
                }
            }
            _ => seen_ns,
        };
        self.known = Some(Known {
            epoch,
            t_capture_ns,
            offset_ns,
        });
        u64::try_from(i128::from(t_capture_ns) + offset_ns).unwrap_or(0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const MS: u64 = 1_000_000;

    #[test]
    fn frames_that_were_held_up_count_from_when_they_were_due() {
        let mut clock = ArrivalClock::default();
        // Ten milliseconds apart on their clock; the third and the fourth come together.
        let arrivals = [(10, 1000), (20, 1010), (30, 1031), (40, 1031), (50, 1040)];
        let due = arrivals.map(|(capture, now)| clock.due_ns(1, capture * MS, now * MS) / MS);
        assert_eq!(due, [1000, 1010, 1020, 1030, 1040]);
    }

    #[test]
    fn a_clock_at_half_speed_is_never_more_than_a_second_behind() {
        let mut clock = ArrivalClock::default();
        for k in 1..=10_000_u64 {
            let (now_ns, capture_ns) = (k * 100 * MS, k * 50 * MS);
            let due_ns = clock.due_ns(1, capture_ns, now_ns);
            assert!(due_ns <= now_ns && now_ns - due_ns <= 1000 * MS, "{k}");
        }
    }

    #[test]
    fn a_slower_clock_is_followed_and_a_new_start_begins_anew() {
        let mut clock = ArrivalClock::default();
        let mut worst_ns = 0;
        for k in 1..=36_000_u64 {
            // An hour at 10 Hz; their clock is 400 ppm slower.
            let (now_ns, capture_ns) = (k * 100 * MS, k * 100 * MS - k * 40_000);
            let due_ns = clock.due_ns(1, capture_ns, now_ns);
            assert!(due_ns <= now_ns);
            worst_ns = worst_ns.max(now_ns - due_ns);
        }
        assert!(worst_ns < MS, "{worst_ns}");
        assert_eq!(clock.due_ns(2, 5, 7_000), 7_000);
        // Set back: as if it began anew.
        assert_eq!(clock.due_ns(2, 4, 9_000), 9_000);
        assert_eq!(clock.due_ns(3, u64::MAX, 9_000), 9_000);
    }
}
