//! Who drives: follows a path of segments by the true pose, as a planner with a perfect map does.
//!
//! Kanayama's lateral law, by distance: curvature = that of the path - y / L² - 2 heading / L. It
//! brings the rover back to its path without overshoot over a few L. Progress is that along the
//! path, not of a clock: a rover that is held back has driven no farther.

use vigil_robot::kinematics::wrap_angle;
use vigil_sensor_sim::DriveCommand;
use vigil_setup::graph_file::DriveSegment;

/// Distance between two points of the path, m: less than a wheel's footprint.
const STEP_M: f64 = 0.02;
/// Distance over which an error is taken back, m: the length of the rover. Chosen by hand.
const BACK_M: f64 = 1.0;
/// Largest correction of the curvature, 1/m: what is left of the steering's limit in a bend.
const CORRECTION_MAX_1_M: f64 = 0.6;

/// A point of the path.
#[derive(Debug, Clone, Copy)]
struct Point {
    pose: [f64; 3],
    curvature_1_m: f64,
    speed_m_s: f64,
}

/// Follows a path.
#[derive(Debug, Clone)]
pub(super) struct Pilot {
    points: Vec<Point>,
    at: usize,
    /// To the left of the path, m, and heading beyond the path's, rad.
    left_m: f64,
    turned_rad: f64,
}

impl Pilot {
    /// At the beginning of the path, which starts at the origin along x.
    pub(super) fn new(segments: &[DriveSegment]) -> Self {
        let mut points = Vec::new();
        let mut pose = [0.0; 3];
        for segment in segments {
            let length_m = segment.duration_s * segment.speed_m_s;
            let steps = (length_m / STEP_M).round().max(1.0) as u32;
            let step_m = length_m / f64::from(steps);
            for _ in 0..steps {
                points.push(Point {
                    pose,
                    curvature_1_m: segment.curvature_1_m,
                    speed_m_s: segment.speed_m_s,
                });
                pose = moved(pose, step_m, segment.curvature_1_m);
            }
        }
        if let Some(last) = points.last().copied() {
            points.push(Point { pose, ..last });
        }
        Self {
            points,
            at: 0,
            left_m: 0.0,
            turned_rad: 0.0,
        }
    }

    /// Takes the rover's pose.
    pub(super) fn take(&mut self, pose: [f64; 3]) {
        while let Some(next) = self.points.get(self.at + 1)
            && offset(next.pose, pose)[0] >= 0.0
        {
            self.at += 1;
        }
        if let Some(point) = self.points.get(self.at) {
            self.left_m = offset(point.pose, pose)[1];
            self.turned_rad = wrap_angle(pose[2] - point.pose[2]);
        }
    }

    /// What is to be driven now.
    pub(super) fn command(&self) -> DriveCommand {
        let Some(point) = self.points.get(self.at) else {
            return DriveCommand::default();
        };
        let back = self.left_m / (BACK_M * BACK_M) + 2.0 * self.turned_rad / BACK_M;
        let correction = back.clamp(-CORRECTION_MAX_1_M, CORRECTION_MAX_1_M);
        DriveCommand {
            curvature_1_m: point.curvature_1_m - correction,
            speed_m_s: point.speed_m_s,
        }
    }

    /// Metres of the path behind the rover.
    pub(super) fn progress_m(&self) -> f64 {
        self.at as f64 * STEP_M
    }

    /// Metres of the path ahead.
    pub(super) fn rest_m(&self) -> f64 {
        (self.points.len() - 1 - self.at) as f64 * STEP_M
    }

    /// Distance from the path, m.
    pub(super) fn off_path_m(&self) -> f64 {
        self.left_m.abs()
    }
}

/// A pose after `step_m` along an arc.
fn moved(pose: [f64; 3], step_m: f64, curvature_1_m: f64) -> [f64; 3] {
    let [x, y, yaw] = pose;
    // The chord of an arc has the heading of its middle; 2 cm of any bend are nearly their chord.
    let middle = yaw + 0.5 * curvature_1_m * step_m;
    [
        x + step_m * middle.cos(),
        y + step_m * middle.sin(),
        yaw + curvature_1_m * step_m,
    ]
}

/// Where `to` lies from `from`: ahead and to the left, m.
fn offset(from: [f64; 3], to: [f64; 3]) -> [f64; 2] {
    let (dx, dy) = (to[0] - from[0], to[1] - from[1]);
    let (sin, cos) = from[2].sin_cos();
    [dx * cos + dy * sin, dy * cos - dx * sin]
}

#[cfg(test)]
mod tests {
    use super::*;

    fn bend() -> Vec<DriveSegment> {
        let segment = |curvature_1_m| DriveSegment {
            duration_s: 20.0,
            curvature_1_m,
            speed_m_s: 0.2,
        };
        vec![segment(0.0), segment(0.4)]
    }

    #[test]
    fn a_path_has_the_length_and_turn_of_its_segments() {
        let pilot = Pilot::new(&bend());
        assert!((pilot.rest_m() - 8.0).abs() < 1e-9);
        let end = pilot.points.last().unwrap().pose;
        assert!((end[2] - 1.6).abs() < 1e-9, "{end:?}");
        // 4 m ahead, then 4 m of a circle of 2.5 m.
        assert!((end[0] - (4.0 + 2.5 * 1.6_f64.sin())).abs() < 1e-3);
        assert!((end[1] - 2.5 * (1.0 - 1.6_f64.cos())).abs() < 1e-3);
    }

    #[test]
    fn a_rover_beside_its_path_returns_to_it() {
        let mut pilot = Pilot::new(&bend());
        let mut pose = [0.0, 0.4, 0.1];
        let mut worst: f64 = 0.0;
        for k in 0..2000 {
            pilot.take(pose);
            let command = pilot.command();
            pose = moved(pose, 0.004, command.curvature_1_m);
            // The last two metres of eight.
            if k > 1500 {
                worst = worst.max(pilot.off_path_m());
            }
        }
        assert!(worst < 0.02, "{worst}");
        assert!((pilot.progress_m() - 8.0).abs() < 0.2);
    }
}
