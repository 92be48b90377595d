//! Recorded frames, one run after the other.

use vigil_blocks::SensorFrame;
use vigil_recording::frames::Run;

/// Why runs cannot be played back.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum PlaybackError {
    /// Nothing to play back.
    #[error("the recording has no frames")]
    Empty,
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

/// Frames as recorded, capture times included.
#[derive(Debug, Clone)]
pub struct Playback {
    runs: Vec<Run>,
    run: usize,
    frame: usize,
}

impl Playback {
    /// Plays `runs` in the given request. Runs without frames are left out.
    ///
    /// # Errors
    /// [`PlaybackError`] if the times or the order of the runs make no sense.
    pub fn new(mut runs: Vec<Run>) -> Result<Self, PlaybackError> {
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
            run: 0,
            frame: 0,
        })
    }

    /// The next frame; `None` at the end.
    #[allow(clippy::should_implement_trait)] // Lends the frame, which an iterator cannot.
    pub fn next(&mut self) -> Option<&SensorFrame> {
        let frames = &self.runs.get(self.run)?.frames;
        let frame = frames.get(self.frame)?;
        self.frame += 1;
        if self.frame == frames.len() {
            (self.run, self.frame) = (self.run + 1, 0);
        }
        Some(frame)
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

    fn play(mut playback: Playback) -> Vec<(u64, u64)> {
        let mut seen = Vec::new();
        while let Some(frame) = playback.next() {
            seen.push((frame.run_id, frame.header.t_capture_ns / 1_000_000));
        }
        assert_eq!(playback.next(), None);
        seen
    }

    #[test]
    fn runs_follow_each_other_frame_by_frame() {
        let runs = vec![run(3, &[50, 100, 170]), run(9, &[]), run(5, &[40, 60])];
        let expected = [(4, 50), (4, 100), (4, 170), (6, 40), (6, 60)];
        assert_eq!(play(Playback::new(runs).unwrap()), expected);
    }

    #[test]
    fn what_makes_no_sense_is_refused() {
        let good = run(1, &[10, 20]);
        assert_eq!(
            Playback::new(vec![run(1, &[])]).unwrap_err(),
            PlaybackError::Empty
        );
        let refused = Playback::new(vec![run(8, &[10, 20, 20])]).unwrap_err();
        let expected = PlaybackError::Time {
            run: 8,
            frame: 2,
            found_ns: 20_000_000,
            before_ns: 20_000_000,
        };
        assert_eq!(refused, expected);
        let refused = Playback::new(vec![good.clone(), good]).unwrap_err();
        assert_eq!(refused, PlaybackError::SameRun { run: 1, run_id: 2 });
    }
}
