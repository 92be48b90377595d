//! Times of recorded runs.

use vigil_blocks::SensorFrame;
use vigil_recording::frames::Run;

use crate::quantile;

/// Capture time of a frame, s.
#[must_use]
pub fn time_s(frame: &SensorFrame) -> f64 {
    frame.header.t_capture_ns as f64 * 1e-9
}

/// Times of the first and the last frame, s; 0 without any.
#[must_use]
pub fn span_s(run: &Run) -> [f64; 2] {
    [run.frames.first(), run.frames.last()].map(|frame| frame.map_or(0.0, time_s))
}

/// Usual time between frames, s.
#[must_use]
pub fn period_s(run: &Run) -> f64 {
    let pairs = run.frames.windows(2);
    let mut gaps_s: Vec<f64> = pairs
        .map(|pair| time_s(&pair[1]) - time_s(&pair[0]))
        .collect();
    quantile(&mut gaps_s, 0.5)
}
