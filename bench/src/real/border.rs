//! Where the border between two grounds lies, from all runs that cross it.
//!
//! The runs of a folder were driven over the same floor, so that one straight line in the world
//! must explain them all. Given the line, the pose tells when each wheel changes its ground, and
//! each run's residuals are a constant plus one step per wheel. The line is the one that leaves
//! the least squares.

use nalgebra::{DMatrix, DVector};
use vigil_recording::frames::Run;
use vigil_robot::Description;

/// Step of the line's place, m.
const STEP_M: f64 = 0.015;
/// Slopes tried, m per m of x.
const SLOPES: [f64; 7] = [-0.12, -0.08, -0.04, 0.0, 0.04, 0.08, 0.12];
/// Ridge on a wheel's step, in observations: a wheel that crosses at the very end says little.
const RIDGE: f64 = 1.0;
/// Frames over which a wheel's place is averaged, either side of the middle.
const SMOOTH: usize = 4;

/// A straight line: y = `y_m` + `slope` (x - `x_m`).
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
pub struct Line {
    /// Its y at `x_m`, m.
    pub y_m: f64,
    /// Where, m: the middle of all poses.
    pub x_m: f64,
    /// Its slope.
    pub slope: f64,
}

/// A fitted border.
#[derive(Debug, Clone, Copy, serde::Serialize)]
pub struct Border {
    /// The line.
    pub line: Line,
    /// Squares of the normalised residuals about each run's mean.
    pub squares_without: f64,
    /// About each run's mean and one step per wheel that crosses.
    pub squares_with: f64,
    /// Wheels that cross, over all runs and observed times.
    pub steps: usize,
}

/// One run: residuals of each observation, normalised, and where the wheels were in each frame.
#[derive(Debug)]
pub struct Crosser {
    /// Time at the end of each observation, s.
    pub t_s: Vec<f64>,
    /// Residuals by channel.
    pub residuals: Vec<Vec<f64>>,
    frame_t_s: Vec<f64>,
    /// Of each wheel, in each frame, m.
    wheels: Vec<Vec<[f64; 2]>>,
}

impl Crosser {
    /// Of a run; `observed`: time at the end of each observation, s, and its residuals.
    #[must_use]
    pub fn new(run: &Run, robot: &Description, observed: &[(f64, Vec<f64>)]) -> Self {
        let place = |pose: [f64; 3], x: f64, y: f64| {
            let (sin, cos) = pose[2].sin_cos();
            [pose[0] + x * cos - y * sin, pose[1] + x * sin + y * cos]
        };
        let of = |x: f64, y: f64| run.frames.iter().map(|f| place(f.pose, x, y)).collect();
        let times = run.frames.iter();
        Self {
            t_s: observed.iter().map(|(t_s, _)| *t_s).collect(),
            residuals: observed.iter().map(|(_, all)| all.clone()).collect(),
            frame_t_s: times.map(|f| f.header.t_capture_ns as f64 * 1e-9).collect(),
            wheels: robot.wheels.iter().map(|w| of(w.x, w.y)).collect(),
        }
    }

    /// When wheels cross the line, s, in order, and which.
    #[must_use]
    pub fn crossings(&self, line: Line) -> Vec<(f64, usize)> {
        let mut out = Vec::new();
        for (i, wheel) in self.wheels.iter().enumerate() {
            let beyond: Vec<f64> = wheel.iter().map(|place| line.beyond(*place)).collect();
            let mean = |at: usize| {
                let near = at.saturating_sub(SMOOTH)..(at + SMOOTH + 1).min(beyond.len());
                beyond[near].iter().sum::<f64>()
            };
            for at in 1..beyond.len() {
                if (mean(at) > 0.0) != (mean(at - 1) > 0.0) {
                    out.push((self.frame_t_s[at], i));
                }
            }
        }
        out.sort_by(|a, b| a.0.total_cmp(&b.0));
        out
    }

    /// Of each observation: 1, then the part of it that each wheel which crosses spent beyond.
    fn terms(&self, line: Line) -> DMatrix<f64> {
        let mut columns = vec![vec![1.0; self.t_s.len()]];
        for wheel in &self.wheels {
            let mut from = 0;
            let mut column = Vec::with_capacity(self.t_s.len());
            for &end_s in &self.t_s {
                let to = self.frame_t_s.partition_point(|&t_s| t_s <= end_s + 1e-6);
                from = from.max(to.saturating_sub(self.frames_each()));
                let inside = wheel.get(from..to).unwrap_or(&[]);
                let beyond = inside.iter().filter(|place| line.beyond(**place) > 0.0);
                column.push(beyond.count() as f64 / inside.len().max(1) as f64);
                from = to;
            }
            if column.iter().any(|part| (part - column[0]).abs() > 1e-9) {
                columns.push(column);
            }
        }
        DMatrix::from_fn(self.t_s.len(), columns.len(), |i, j| columns[j][i])
    }

    /// Frames in an observation.
    fn frames_each(&self) -> usize {
        let frame_s = self.frame_t_s.windows(2).map(|pair| pair[1] - pair[0]);
        let frame_s = frame_s.fold(f64::INFINITY, f64::min);
        let observed_s = self.t_s.windows(2).map(|pair| pair[1] - pair[0]);
        let observed_s = observed_s.fold(f64::INFINITY, f64::min);
        (observed_s / frame_s).round() as usize
    }

    /// Squares left by the terms, and how many steps they hold.
    fn squares(&self, terms: &DMatrix<f64>) -> (f64, usize) {
        let steps = terms.ncols() - 1;
        let mut normal = terms.transpose() * terms;
        for i in 1..terms.ncols() {
            normal[(i, i)] += RIDGE;
        }
        let Some(normal) = normal.cholesky() else {
            return (f64::INFINITY, steps);
        };
        let channels = self.residuals.first().map_or(0, Vec::len);
        let mut left = 0.0;
        for channel in 0..channels {
            let values = self.residuals.iter().map(|all| all[channel]);
            let values = DVector::from_iterator(self.residuals.len(), values);
            let weights = normal.solve(&(terms.transpose() * &values));
            left += (values - terms * weights).norm_squared();
        }
        (left, steps)
    }
}

impl Line {
    /// How far a place lies beyond it, along y, m.
    fn beyond(self, [x, y]: [f64; 2]) -> f64 {
        y - self.y_m - self.slope * (x - self.x_m)
    }
}

/// The line that explains the runs best; none without runs.
#[must_use]
pub fn fit(runs: &[Crosser]) -> Option<Border> {
    let places = || runs.iter().flat_map(|run| run.wheels.iter().flatten());
    let along = |i: usize| {
        let all = places().map(move |place| place[i]);
        all.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), v| {
            (low.min(v), high.max(v))
        })
    };
    let ((x_low, x_high), (y_low, y_high)) = (along(0), along(1));
    let steps = ((y_high - y_low) / STEP_M).ceil();
    let mut best: Option<Border> = None;
    let one = |run: &Crosser| run.squares(&DMatrix::from_element(run.t_s.len(), 1, 1.0)).0;
    let squares_without = runs.iter().map(one).sum();
    for i in 0..steps.max(0.0) as usize {
        for slope in SLOPES {
            let line = Line {
                y_m: y_low + STEP_M * i as f64,
                x_m: 0.5 * (x_low + x_high),
                slope,
            };
            let each = runs.iter().map(|run| run.squares(&run.terms(line)));
            let (left, count) = each.fold((0.0, 0), |(l, c), (left, n)| (l + left, c + n));
            if best.is_none_or(|best| left < best.squares_with) {
                best = Some(Border {
                    line,
                    squares_without,
                    squares_with: left,
                    steps: count,
                });
            }
        }
    }
    best
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use vigil_blocks::SensorFrame;

    /// A run along x that drifts over y = -2; each wheel beyond adds 1 to the only channel.
    fn crosser(drift: f64, robot: &Description) -> Crosser {
        let frame = |i: u32| {
            let mut frame = SensorFrame::default();
            frame.header.t_capture_ns = u64::from(i) * 31_250_000;
            frame.pose = [0.006 * f64::from(i), -2.2 + drift * f64::from(i), 0.3];
            frame
        };
        let run = Run {
            id: 1,
            frames: (0..320).map(frame).collect(),
        };
        let (sin, cos) = 0.3_f64.sin_cos();
        let beyond = |pose: [f64; 3]| {
            let y = robot.wheels.iter().map(|w| pose[1] + w.x * sin + w.y * cos);
            y.filter(|&y| y > -2.0).count() as f64
        };
        let observed: Vec<(f64, Vec<f64>)> = run
            .frames
            .chunks(8)
            .map(|chunk| {
                let sum: f64 = chunk.iter().map(|f| beyond(f.pose)).sum();
                let t_s = chunk[7].header.t_capture_ns as f64 * 1e-9;
                (t_s, vec![0.4 + sum / 8.0])
            })
            .collect();
        Crosser::new(&run, robot, &observed)
    }

    #[test]
    fn the_border_is_found_where_it_lies_and_wheels_cross_it_in_turn() {
        let path = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
        let robot = vigil_setup::load_robot(&path.join("config/robots/robotino.toml")).unwrap();
        let drifts = [0.0009, 0.0011, 0.0013, 0.0016];
        let runs = drifts.map(|drift| crosser(drift, &robot));
        let border = fit(&runs).unwrap();
        assert!((border.line.y_m + 2.0).abs() < STEP_M, "{border:?}");
        assert_eq!(border.line.slope, 0.0);
        assert!(border.squares_with < 0.05 * border.squares_without);
        let line = Line {
            y_m: -2.0,
            x_m: 0.0,
            slope: 0.0,
        };
        // Wheel A leads: its y in the robot's frame, turned by 0.3 rad.
        let (sin, cos) = 0.3_f64.sin_cos();
        let at = |i: usize| (0.2 - (robot.wheels[i].x * sin + robot.wheels[i].y * cos)) / 0.0011;
        let found = runs[1].crossings(line);
        let wheels: Vec<usize> = found.iter().map(|(_, wheel)| *wheel).collect();
        assert_eq!(wheels, [0, 1, 2]);
        for (t_s, wheel) in found {
            assert!((t_s - at(wheel) * 0.03125).abs() < 0.07, "{t_s} {wheel}");
        }
    }
}
