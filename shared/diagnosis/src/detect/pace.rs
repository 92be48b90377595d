//! Whether frames come when they are due.

use vigil_checkpoint::CheckpointValue;
use vigil_robot::publisher_check::{Finding, FindingKind};

/// Length of a window, s, and windows in a row that must agree on a finding. A window is as long as
/// what blinds (`blindness::BLIND_S`); a single one may be the machine's doing.
const WINDOW_S: f64 = 1.0;
const WINDOWS: u32 = 2;
/// Share of the deadlines of a window that may pass before their frames come. Chosen by hand: three
/// in ten. Smaller reports a loaded machine, larger hides a publisher in bursts of two.
const LATE_MAX: f64 = 0.3;
/// Frames this much closer together or further apart than the graph's period are of another rate.
/// Chosen by hand: the mean of a second's jitter stays far below half a period, and the next likely
/// mistake, half or twice the rate, far beyond.
const RATE_MAX: f64 = 1.5;
/// A pause beyond this, in periods, is a gap and says nothing of the rate. Chosen by hand: five
/// frames lost in a row. Smaller hides a rate of a sixth, larger counts gaps as a slow rate.
const GAP_PERIODS: f64 = 6.0;

/// Counts frames and missed deadlines by the journal.
#[derive(Debug, Clone, CheckpointValue)]
pub(crate) struct Pace {
    period_s: f64,
    frames: u32,
    missed: u32,
    spacing_s: f64,
    t_ns: u64,
    suspected: Option<FindingKind>,
    windows: u32,
    reported: [bool; 2],
}

impl Pace {
    /// Of a graph of this period, s.
    pub(crate) const fn new(period_s: f64) -> Self {
        Self {
            period_s,
            frames: 0,
            missed: 0,
            spacing_s: 0.0,
            t_ns: 0,
            suspected: None,
            windows: 0,
            reported: [false; 2],
        }
    }

    /// Deadlines passed without input.
    pub(crate) const fn miss(&mut self, count: u32) {
        self.missed = self.missed.saturating_add(count);
    }

    /// Takes a frame; a finding once a window is full.
    pub(crate) fn take(&mut self, t_capture_ns: u64) -> Option<Finding> {
        let spacing_s = t_capture_ns.saturating_sub(self.t_ns) as f64 * 1e-9;
        self.t_ns = t_capture_ns;
        if spacing_s > GAP_PERIODS * self.period_s {
            (self.frames, self.missed, self.spacing_s) = (0, 0, 0.0);
            return None;
        }
        self.frames += 1;
        self.spacing_s += spacing_s;
        if self.spacing_s < WINDOW_S {
            return None;
        }
        let (frames, missed) = (f64::from(self.frames), f64::from(self.missed));
        let rate = self.period_s * frames / self.spacing_s;
        let late = missed / frames;
        (self.frames, self.missed, self.spacing_s) = (0, 0, 0.0);
        let found = if !(1.0 / RATE_MAX..=RATE_MAX).contains(&rate) {
            Some((FindingKind::Rate, rate))
        } else if late > LATE_MAX {
            Some((FindingKind::Late, late.min(1.0)))
        } else {
            None
        };
        let kind = found.map(|(kind, _)| kind);
        self.windows = match kind == self.suspected {
            true => self.windows.saturating_add(1),
            false => 1,
        };
        self.suspected = kind;
        let (kind, value) = found.filter(|_| self.windows >= WINDOWS)?;
        let reported = &mut self.reported[usize::from(kind == FindingKind::Late)];
        (!std::mem::replace(reported, true)).then_some(Finding {
            kind,
            wheel: None,
            value,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const PERIOD_NS: u64 = 20_000_000;

    /// What is found in 4 s of journal entries: so many misses, then so many frames so far apart.
    fn found(misses: u32, frames: u64, spacing_ns: u64) -> Option<(FindingKind, u64)> {
        let mut pace = Pace::new(0.02);
        let (mut t_ns, mut first_ns) = (1_000_000_000, 0);
        while t_ns < 5_000_000_000 {
            pace.miss(misses);
            for _ in 0..frames {
                t_ns += spacing_ns;
                let found = pace.take(t_ns);
                first_ns = t_ns - 1_000_000_000;
                if let Some(finding) = found {
                    return Some((finding.kind, first_ns / 100_000_000));
                }
            }
        }
        assert!(first_ns > 0);
        None
    }

    #[test]
    fn bursts_late_frames_and_other_rates_are_reported_within_three_seconds() {
        assert_eq!(found(0, 1, PERIOD_NS), None);
        assert_eq!(found(0, 1, PERIOD_NS * 10 / 9), None);
        // One in ten is lost.
        assert_eq!(found(1, 9, PERIOD_NS * 10 / 9), None);
        // Ten at once each 200 ms; each after its deadline; half as fast; twice.
        assert!(matches!(
            found(9, 10, PERIOD_NS),
            Some((FindingKind::Late, 19..=25))
        ));
        assert!(matches!(
            found(1, 1, PERIOD_NS),
            Some((FindingKind::Late, 19..=25))
        ));
        assert!(matches!(
            found(1, 1, 2 * PERIOD_NS),
            Some((FindingKind::Rate, 19..=25))
        ));
        assert!(matches!(
            found(0, 1, PERIOD_NS / 2),
            Some((FindingKind::Rate, 19..=25))
        ));
    }

    #[test]
    fn a_finding_is_reported_once_and_a_gap_begins_the_window_anew() {
        let mut pace = Pace::new(0.02);
        let (mut t_ns, mut findings) = (0, 0);
        for _ in 0..500 {
            t_ns += PERIOD_NS / 2;
            findings += u32::from(pace.take(t_ns).is_some());
        }
        assert_eq!(findings, 1);
        let mut gaps = Pace::new(0.02);
        t_ns = 0;
        for k in 0..2000 {
            // Twice as fast, with a gap each half second.
            t_ns += if k % 50 == 0 {
                10 * PERIOD_NS
            } else {
                PERIOD_NS / 2
            };
            assert_eq!(gaps.take(t_ns), None);
        }
    }
}
