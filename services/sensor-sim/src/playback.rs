//! Recorded frames, one run after the other.

use vigil_blocks::SensorFrame;
use vigil_evaluation::frames::Run;

/// Interval assumed after a recording's only frame, ns.
const INTERVAL_DEFAULT_NS: u64 = 50_000_000;
/// Speeds relative to the recording that are allowed.
const SPEED_RANGE: std::ops::RangeInclusive<f64> = 0.01..=100.0;

/// Why runs cannot be played back.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum PlaybackError {
    /// Nothing to play back.
    #[error("the recording has no frames")]
    Empty,
    /// The speed is out of range.
    #[error("speed {0} is out of range: allowed is 0.01 to 100 times the recording's")]
    Speed(f64),
    /// Time stands still or goes back.
    #[error(
        "run {run}, frame {frame}: the time {found_ns} ns is not after the one before, \
         {before_ns} ns"
    )]
    Time {
        /// Id of the run.
        run: u32,
        /// Index of the frame in the run.
        frame: usize,
        /// Its capture time, ns.
        found_ns: u64,
        /// Capture time of the frame before, ns.
        before_ns: u64,
    },
    /// Two runs in a row are one to the filters.
    #[error("run {run} follows a run of the same run_id {run_id}: the filters would not be reset")]
    SameRun {
        /// Id of the run.
        run: u32,
        /// Its frames' `run_id`.
        run_id: u64,
    },
}

/// Frames as recorded (capture times included), with the delay from each to the next.
#[derive(Debug, Clone)]
pub struct Playback {
    runs: Vec<Run>,
    speed: f64,
    run: usize,
    frame: usize,
    /// The last interval within a run: the next run starts after it.
    interval_ns: u64,
}

impl Playback {
    /// Plays `runs` in the given order at `speed` times the recorded rate (0.01 to 100). Runs
    /// without frames are left out.
    ///
    /// # Errors
    /// [`PlaybackError`] if the speed, the times or the order of the runs make no sense.
    pub fn new(mut runs: Vec<Run>, speed: f64) -> Result<Self, PlaybackError> {
        if !SPEED_RANGE.contains(&speed) {
            return Err(PlaybackError::Speed(speed));
        }
        runs.retain(|run| !run.frames.is_empty());
        if runs.is_empty() {
            return Err(PlaybackError::Empty);
        }
        let mut before = None;
        for run in &runs {
            check_times(run)?;
            let run_id = run.frames.first().map(|frame| frame.run_id);
            if let (true, Some(run_id)) = (run_id == before, run_id) {
                return Err(PlaybackError::SameRun {
                    run: run.id,
                    run_id,
                });
            }
            before = run.frames.last().map(|frame| frame.run_id);
        }
        Ok(Self {
            runs,
            speed,
            run: 0,
            frame: 0,
            interval_ns: INTERVAL_DEFAULT_NS,
        })
    }

    /// The next frame, and the delay in ns until the one after it is due; `None` at the end. The
    /// first frame of a run is due one frame interval after the last of the run before.
    #[allow(clippy::should_implement_trait)] // Lends the frame, which an iterator cannot.
    pub fn next(&mut self) -> Option<(&SensorFrame, u64)> {
        let frames = &self.runs.get(self.run)?.frames;
        let frame = frames.get(self.frame)?;
        if let Some(after) = frames.get(self.frame + 1) {
            self.interval_ns = after.header.t_capture_ns - frame.header.t_capture_ns;
            self.frame += 1;
        } else {
            (self.run, self.frame) = (self.run + 1, 0);
        }
        Some((frame, (self.interval_ns as f64 / self.speed).round() as u64))
    }

    /// Frames in all runs.
    #[must_use]
    pub fn frame_count(&self) -> usize {
        self.runs.iter().map(|run| run.frames.len()).sum()
    }
}

fn check_times(run: &Run) -> Result<(), PlaybackError> {
    for (index, pair) in run.frames.windows(2).enumerate() {
        let [before_ns, found_ns] = [0, 1].map(|i| pair[i].header.t_capture_ns);
        if found_ns <= before_ns {
            return Err(PlaybackError::Time {
                run: run.id,
                frame: index + 1,
                found_ns,
                before_ns,
            });
        }
    }
    Ok(())
}

#[cfg(test)]
#[allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]
mod tests {
    use super::*;

    fn run(id: u32, times_ms: &[u64]) -> Run {
        let frame = |&ms: &u64| {
            let mut frame = SensorFrame {
                run_id: u64::from(id) + 1,
                ..SensorFrame::default()
            };
            frame.header.t_capture_ns = ms * 1_000_000;
            frame
        };
        Run {
            id,
            frames: times_ms.iter().map(frame).collect(),
        }
    }

    fn play(mut playback: Playback) -> Vec<(u64, u64, u64)> {
        let mut seen = Vec::new();
        while let Some((frame, delay_ns)) = playback.next() {
            seen.push((
                frame.run_id,
                frame.header.t_capture_ns / 1_000_000,
                delay_ns,
            ));
        }
        assert_eq!(playback.next(), None);
        seen
    }

    #[test]
    fn runs_follow_each_other_at_the_recorded_intervals() {
        let runs = vec![run(3, &[50, 100, 170]), run(9, &[]), run(5, &[40, 60])];
        let playback = Playback::new(runs.clone(), 1.0).unwrap();
        assert_eq!(playback.frame_count(), 5);
        let expected = [
            (4, 50, 50_000_000),
            (4, 100, 70_000_000),
            (4, 170, 70_000_000),
            (6, 40, 20_000_000),
            (6, 60, 20_000_000),
        ];
        assert_eq!(play(playback), expected);
        let quarter = expected.map(|(run, ms, delay_ns)| (run, ms, delay_ns / 4));
        assert_eq!(play(Playback::new(runs, 4.0).unwrap()), quarter);
    }

    #[test]
    fn what_makes_no_sense_is_refused() {
        let good = run(1, &[10, 20]);
        for speed in [0.0, -1.0, 101.0, f64::NAN] {
            let refused = Playback::new(vec![good.clone()], speed).unwrap_err();
            assert!(refused.to_string().contains("0.01 to 100"), "{refused}");
        }
        assert_eq!(
            Playback::new(vec![run(1, &[])], 1.0).unwrap_err(),
            PlaybackError::Empty
        );
        let refused = Playback::new(vec![run(8, &[10, 20, 20])], 1.0).unwrap_err();
        let expected = PlaybackError::Time {
            run: 8,
            frame: 2,
            found_ns: 20_000_000,
            before_ns: 20_000_000,
        };
        assert_eq!(refused, expected);
        let refused = Playback::new(vec![good.clone(), good], 1.0).unwrap_err();
        assert_eq!(refused, PlaybackError::SameRun { run: 1, run_id: 2 });
    }
}
