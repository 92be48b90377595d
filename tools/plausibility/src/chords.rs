//! Stretches of a second of motion, over which commands and measurements are compared: so short
//! that a path is nearly straight, so long that noise and lag hardly count.

use vigil_blocks::SensorFrame;
use vigil_inference::angle::wrap;
use vigil_robot::Description;

use super::seconds;

/// Least duration of a chord, s, and frames in it: a fifth of them is averaged at either end.
const CHORD_S: f64 = 1.0;
const CHORD_FRAMES: usize = 10;

/// One stretch.
pub(super) struct Chord<'a> {
    frames: &'a [&'a SensorFrame],
}

/// The chords of pieces of motion without a break; what is left at the end of each is none.
pub(super) fn chords<'a>(pieces: &'a [&'a [&'a SensorFrame]]) -> impl Iterator<Item = Chord<'a>> {
    pieces.iter().flat_map(|frames| {
        let mut from = 0;
        std::iter::from_fn(move || {
            let until = seconds(frames.get(from)?) + CHORD_S;
            let long = frames
                .get(from..)?
                .iter()
                .position(|f| seconds(f) >= until)?;
            let to = from + long.max(CHORD_FRAMES);
            let chord = frames.get(from..=to)?;
            from = to;
            Some(Chord { frames: chord })
        })
    })
}

impl Chord<'_> {
    /// Mean of a value over all frames.
    pub fn mean(&self, value: impl Fn(&SensorFrame) -> f64) -> f64 {
        let sum: f64 = self.frames.iter().map(|frame| value(frame)).sum();
        sum / self.frames.len().max(1) as f64
    }

    /// Mean velocity that the commands ask for: forward m/s, left m/s, yaw rate rad/s.
    pub fn mean_twist(&self, robot: &Description) -> [f64; 3] {
        [0, 1, 2].map(|axis| self.mean(|frame| robot.twist(&frame.command)[axis]))
    }

    /// The frames at either end, a fifth of all each.
    fn ends(&self) -> [&[&SensorFrame]; 2] {
        let end = self.frames.len().div_ceil(5);
        let start = self.frames.len() - end;
        [&self.frames[..end], &self.frames[start..]]
    }

    /// Time between the means of the ends, s.
    pub fn duration_s(&self) -> f64 {
        let [start, stop] = self.ends().map(|end| {
            let sum: f64 = end.iter().map(|frame| seconds(frame)).sum();
            sum / end.len().max(1) as f64
        });
        stop - start
    }

    /// Displacement from the mean pose at the start to that at the end, forward and left in the
    /// middle heading, m, and turn, rad.
    pub fn moved(&self) -> [f64; 3] {
        let [start, stop] = self.ends().map(mean_pose);
        let (dx, dy) = (stop[0] - start[0], stop[1] - start[1]);
        let turn = wrap(stop[2] - start[2]);
        let (sin, cos) = (start[2] + 0.5 * turn).sin_cos();
        [dx * cos + dy * sin, dy * cos - dx * sin, turn]
    }
}

fn mean_pose(frames: &[&SensorFrame]) -> [f64; 3] {
    let Some(first) = frames.first() else {
        return [0.0; 3];
    };
    let apart = |axis: usize, frame: &SensorFrame| match axis {
        2 => wrap(frame.pose[2] - first.pose[2]),
        _ => frame.pose[axis] - first.pose[axis],
    };
    [0, 1, 2].map(|axis| {
        let sum: f64 = frames.iter().map(|frame| apart(axis, frame)).sum();
        first.pose[axis] + sum / frames.len() as f64
    })
}
