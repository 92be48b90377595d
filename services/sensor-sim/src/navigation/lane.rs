//! The lane that the robot keeps: beside its path by so much.

use vigil_robot::kinematics::wrap_angle;

use super::path::Path;

/// The robot steers for the point so far ahead, m. Chosen by hand for a rover at 0.2 m/s: a nearer
/// point makes it weave, a farther one cuts corners.
const LOOK_AHEAD_M: f64 = 0.7;

/// Offset to the left of the path: from one value to another over a length.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(super) struct Lane {
    from_m: f64,
    to_m: f64,
    start_m: f64,
}

impl Lane {
    /// A lane that changes from its present offset at `start_m` to `to_m`.
    pub(super) fn change(self, start_m: f64, to_m: f64) -> Self {
        Self {
            from_m: self.at(start_m),
            to_m,
            start_m,
        }
    }

    /// The offset at a distance along the path, m.
    pub(super) fn at(self, along_m: f64) -> f64 {
        let share = ((along_m - self.start_m) / self.length_m()).clamp(0.0, 1.0);
        let smooth = share * share * (3.0 - 2.0 * share);
        self.from_m + (self.to_m - self.from_m) * smooth
    }

    /// Where the change is complete, m along the path.
    pub(super) fn end_m(self) -> f64 {
        self.start_m + self.length_m()
    }

    /// Length of the change, m: its largest curvature, 6 offset / length^2, stays below 0.7 1/m.
    fn length_m(self) -> f64 {
        3.0 * (self.to_m - self.from_m).abs() + 0.3
    }

    /// Curvature, 1/m, that leads from `pose` toward the lane, `turned_rad` off its direction.
    pub(super) fn pursue(self, path: &Path, along_m: f64, pose: [f64; 3], turned_rad: f64) -> f64 {
        let ahead_m = along_m + LOOK_AHEAD_M;
        let [x, y, _] = path.beside(ahead_m, self.at(ahead_m));
        let (x, y) = (x - pose[0], y - pose[1]);
        let bearing_rad = wrap_angle(y.atan2(x) + turned_rad - pose[2]);
        let distance_m = x.hypot(y).max(LOOK_AHEAD_M / 2.0);
        // Behind the robot the chord says little: turn as sharply as beside it.
        let sine = if bearing_rad.abs() > std::f64::consts::FRAC_PI_2 {
            1.0_f64.copysign(bearing_rad)
        } else {
            bearing_rad.sin()
        };
        2.0 * sine / distance_m
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_lane_changes_smoothly_and_back() {
        let lane = Lane::default().change(2.0, 0.8);
        assert_eq!((lane.at(1.0), lane.at(2.0)), (0.0, 0.0));
        assert!((lane.at(2.0 + 2.7 / 2.0) - 0.4).abs() < 1e-12);
        assert!((lane.end_m() - 4.7).abs() < 1e-12 && (lane.at(9.0) - 0.8).abs() < 1e-12);
        let back = lane.change(6.0, 0.0);
        assert!((back.at(6.0) - 0.8).abs() < 1e-12 && back.at(back.end_m()).abs() < 1e-12);
    }

    #[test]
    fn the_robot_steers_toward_its_lane() {
        let path = Path::new(&[[0.0, 0.0], [9.0, 0.0]]);
        let lane = Lane::default();
        assert_eq!(lane.pursue(&path, 1.0, [1.0, 0.0, 0.0], 0.0), 0.0);
        assert!(lane.pursue(&path, 1.0, [1.0, 0.3, 0.0], 0.0) < -0.5);
        assert!(lane.pursue(&path, 1.0, [1.0, 0.0, 3.0], 0.0) < -2.5);
        assert!(lane.pursue(&path, 1.0, [1.0, 0.0, 0.0], 0.5) > 0.5);
    }
}
