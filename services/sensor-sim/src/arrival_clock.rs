//! Capture times of a publisher with its own clock, placed on this machine's clock.

use vigil_blocks::Header;

/// Share by which the publisher's clock may run slower than ours. Chosen: five times the drift of a
/// poor quartz (100 ppm).
const DRIFT_MAX: f64 = 5e-4;
/// Delay of a frame, ns, beyond which its publisher's clock is taken to have changed. Chosen: a
/// second, longer than any stall that a robot drives through.
const HELD_UP_MAX_NS: i128 = 1_000_000_000;

/// Converts capture times of another clock to ours by the shortest transport time of any frame so
/// far, so that a delayed frame still counts from when it was due.
#[derive(Debug, Clone, Copy, Default)]
pub struct ArrivalClock {
    known: Option<ClockOffset>,
}

#[derive(Debug, Clone, Copy)]
struct ClockOffset {
    epoch: u64,
    t_capture_ns: u64,
    /// Our clock minus the publisher's, ns.
    offset_ns: i128,
}

/// Frames of one source that are here at the same time.
#[derive(Debug, Clone, Copy)]
pub struct ArrivalBatch<I> {
    /// Their headers.
    pub headers: I,
    /// False if more of them wait: then the newest of these may be delayed as well.
    pub is_complete: bool,
}

impl ArrivalClock {
    /// Sets a frame's `t_schedule_ns`, if its publisher has left it 0, for a frame that is read at
    /// `now_ns`; returns the clock after it. No frame of the batch can be delayed for longer than
    /// the newest one of its epoch.
    #[must_use]
    pub fn date<'a>(
        self,
        header: &mut Header,
        here: ArrivalBatch<impl IntoIterator<Item = &'a Header>>,
        now_ns: u64,
    ) -> Self {
        if header.t_schedule_ns != 0 {
            return self;
        }
        let (epoch, t_capture_ns) = (header.epoch, header.t_capture_ns);
        let same = here
            .headers
            .into_iter()
            .filter(|other| other.epoch == epoch);
        let newest_ns = same.map(|other| other.t_capture_ns).max();
        let newest_ns = newest_ns.unwrap_or(0).max(t_capture_ns);
        let seen_ns = i128::from(now_ns) - i128::from(newest_ns);
        let offset_ns = match self.known {
            Some(known) if known.epoch == epoch && known.t_capture_ns <= t_capture_ns => {
                let elapsed_ns = (t_capture_ns - known.t_capture_ns) as f64;
                let drifted_ns = known.offset_ns + (DRIFT_MAX * elapsed_ns).ceil() as i128;
                if here.is_complete && seen_ns - drifted_ns > HELD_UP_MAX_NS {
                    seen_ns
                } else {
                    drifted_ns.min(seen_ns)
                }
            }
            _ => seen_ns,
        };
        header.t_schedule_ns = u64::try_from(i128::from(t_capture_ns) + offset_ns).unwrap_or(0);
        Self {
            known: Some(ClockOffset {
                epoch,
                t_capture_ns,
                offset_ns,
            }),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const MS: u64 = 1_000_000;

    fn all<I>(headers: I) -> ArrivalBatch<I> {
        ArrivalBatch {
            headers,
            is_complete: true,
        }
    }

    /// When a frame was due that has come alone, and was taken.
    fn due_ns(clock: &mut ArrivalClock, epoch: u64, t_capture_ns: u64, now_ns: u64) -> u64 {
        let mut header = Header {
            epoch,
            t_capture_ns,
            ..Header::default()
        };
        *clock = clock.date(&mut header, all([]), now_ns);
        header.t_schedule_ns
    }

    #[test]
    fn frames_that_were_held_up_count_from_when_they_were_due() {
        let mut clock = ArrivalClock::default();
        // Ten milliseconds apart on their clock; the third and the fourth come together.
        let arrivals = [(10, 1000), (20, 1010), (30, 1031), (40, 1031), (50, 1040)];
        let due = arrivals.map(|(capture, now)| due_ns(&mut clock, 1, capture * MS, now * MS) / MS);
        assert_eq!(due, [1000, 1010, 1020, 1030, 1040]);
    }

    #[test]
    fn frames_that_come_together_are_as_far_apart_as_they_were_captured_from_the_first_on() {
        let mut clock = ArrivalClock::default();
        let here = [10, 20, 30].map(|capture| Header {
            epoch: 1,
            t_capture_ns: capture * MS,
            ..Header::default()
        });
        let due = here.map(|mut header| {
            clock = clock.date(&mut header, all(&here), 1000 * MS);
            header.t_schedule_ns / MS
        });
        assert_eq!(due, [980, 990, 1000]);
    }

    #[test]
    fn a_frame_that_was_not_taken_changes_nothing() {
        let mut clock = ArrivalClock::default();
        assert_eq!(due_ns(&mut clock, 1, 10 * MS, 1000 * MS), 1000 * MS);
        // Of another epoch, and from the future of its own clock.
        let mut foreign = Header {
            epoch: 2,
            t_capture_ns: 90 * MS,
            ..Header::default()
        };
        let _ = clock.date(&mut foreign, all([]), 1001 * MS);
        assert_eq!(due_ns(&mut clock, 1, 20 * MS, 1015 * MS) / MS, 1010);
    }

    #[test]
    fn a_clock_at_half_speed_is_never_more_than_a_second_behind() {
        let mut clock = ArrivalClock::default();
        for k in 1..=10_000_u64 {
            let (now_ns, capture_ns) = (k * 100 * MS, k * 50 * MS);
            let due_ns = due_ns(&mut clock, 1, capture_ns, now_ns);
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
            let due_ns = due_ns(&mut clock, 1, capture_ns, now_ns);
            assert!(due_ns <= now_ns);
            worst_ns = worst_ns.max(now_ns - due_ns);
        }
        assert!(worst_ns < MS, "{worst_ns}");
        assert_eq!(due_ns(&mut clock, 2, 5, 7_000), 7_000);
        // Set back: as if it began anew.
        assert_eq!(due_ns(&mut clock, 2, 4, 9_000), 9_000);
        assert_eq!(due_ns(&mut clock, 3, u64::MAX, 9_000), 9_000);
    }

    #[test]
    fn a_long_stall_that_is_read_in_pieces_leaves_the_frames_as_far_apart_as_they_were() {
        let mut clock = ArrivalClock::default();
        assert_eq!(due_ns(&mut clock, 1, 10 * MS, 1000 * MS) / MS, 1000);
        // Three seconds later, 300 frames are here; they are read 64 at a time.
        let waiting: Vec<Header> = (2..=300)
            .map(|k| Header {
                epoch: 1,
                t_capture_ns: k * 10 * MS,
                ..Header::default()
            })
            .collect();
        let mut due_ms = Vec::new();
        for piece in waiting.chunks(64) {
            for mut header in piece.iter().copied() {
                let here = ArrivalBatch {
                    headers: piece,
                    is_complete: piece.len() < 64,
                };
                clock = clock.date(&mut header, here, 3990 * MS);
                due_ms.push(header.t_schedule_ns / MS);
            }
        }
        // The other clock may be slow: a little more at each frame, taken back at the newest.
        let apart_ms = due_ms.windows(2).map(|pair| pair[1] - pair[0]);
        assert!(
            apart_ms.into_iter().all(|ms| (8..=11).contains(&ms)),
            "{due_ms:?}"
        );
        assert!((3989..=3990).contains(&due_ms[due_ms.len() - 1]));
    }
}
