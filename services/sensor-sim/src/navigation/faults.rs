//! Faults of the navigation: a wrong pose, a wrong heading, a range sensor that is blind or sees
//! phantoms.

use vigil_robot::kinematics::wrap_angle;
use vigil_setup::graph_file::{Trouble, TroubleKind};

/// Faults of the navigation: those still to come, and what those that came have done.
#[derive(Debug, Clone)]
pub(super) struct NavigationFaults {
    pending: Vec<Trouble>,
    /// Rotation, rad, about `pivot`, then a shift, m: from true to believed poses.
    offset: Option<FrameOffset>,
    /// Error of the heading by which the robot steers, rad.
    pub(super) wrong_heading_rad: f64,
    /// The range sensor sees nothing.
    pub(super) is_blind: bool,
    /// Where the range sensor sees what is not there.
    pub(super) phantom: Option<[f64; 2]>,
}

/// A rigid motion of the believed frame.
#[derive(Debug, Clone, Copy)]
struct FrameOffset {
    pivot: [f64; 2],
    yaw_rad: f64,
    shift_m: [f64; 2],
}

impl NavigationFaults {
    pub(super) fn new(faults: &[Trouble]) -> Self {
        let mut pending = faults.to_vec();
        pending.sort_by(|a, b| b.at_s.total_cmp(&a.at_s));
        Self {
            pending,
            offset: None,
            wrong_heading_rad: 0.0,
            is_blind: false,
            phantom: None,
        }
    }

    /// Starts what is due at `t_s`, for a robot at the true `pose`.
    pub(super) fn apply_due(&mut self, t_s: f64, pose: [f64; 3]) {
        while self.pending.last().is_some_and(|next| next.at_s <= t_s) {
            let Some(trouble) = self.pending.pop() else {
                break;
            };
            match trouble.kind {
                TroubleKind::Mislocalised => {
                    self.offset = Some(FrameOffset {
                        pivot: [pose[0], pose[1]],
                        yaw_rad: trouble.yaw_rad,
                        shift_m: [trouble.x_m, trouble.y_m],
                    });
                }
                TroubleKind::WrongHeading => self.wrong_heading_rad = trouble.yaw_rad,
                TroubleKind::Blind => self.is_blind = true,
                TroubleKind::Phantom => self.phantom = Some([trouble.x_m, trouble.y_m]),
            }
        }
    }

    /// The pose that the robot believes when it is at the true `pose`.
    pub(super) fn to_believed(&self, pose: [f64; 3]) -> [f64; 3] {
        self.offset.map_or(pose, |offset| {
            let (sin, cos) = offset.yaw_rad.sin_cos();
            let (x, y) = (pose[0] - offset.pivot[0], pose[1] - offset.pivot[1]);
            [
                offset.pivot[0] + offset.shift_m[0] + cos * x - sin * y,
                offset.pivot[1] + offset.shift_m[1] + sin * x + cos * y,
                wrap_angle(pose[2] + offset.yaw_rad),
            ]
        })
    }

    /// The true place of a believed one.
    pub(super) fn to_true(&self, place: [f64; 2]) -> [f64; 2] {
        self.offset.map_or(place, |offset| {
            let (sin, cos) = offset.yaw_rad.sin_cos();
            let x = place[0] - offset.pivot[0] - offset.shift_m[0];
            let y = place[1] - offset.pivot[1] - offset.shift_m[1];
            [
                offset.pivot[0] + cos * x + sin * y,
                offset.pivot[1] - sin * x + cos * y,
            ]
        })
    }

    /// True if the believed pose is wrong.
    pub(super) const fn is_lost(&self) -> bool {
        self.offset.is_some()
    }

    /// Corrects pose and heading; true if the believed pose jumps.
    pub(super) const fn relocalise(&mut self) -> bool {
        self.wrong_heading_rad = 0.0;
        self.offset.take().is_some()
    }

    /// A person repairs the range sensor.
    pub(super) const fn repair_sensor(&mut self) {
        self.is_blind = false;
        self.phantom = None;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_offset_and_its_inverse_cancel_out() {
        let mut faults = NavigationFaults::new(&[
            Trouble {
                kind: TroubleKind::Blind,
                at_s: 9.0,
                x_m: 0.0,
                y_m: 0.0,
                yaw_rad: 0.0,
            },
            Trouble {
                kind: TroubleKind::Mislocalised,
                at_s: 2.0,
                x_m: 1.0,
                y_m: -0.5,
                yaw_rad: 0.3,
            },
        ]);
        let pose = [3.0, 0.2, 0.1];
        faults.apply_due(1.9, pose);
        assert_eq!(faults.to_believed(pose), pose);
        faults.apply_due(2.0, pose);
        assert!(!faults.is_blind);
        let believed = faults.to_believed(pose);
        for (found, expected) in believed.iter().zip([4.0, -0.3, 0.4]) {
            assert!((found - expected).abs() < 1e-12, "{believed:?}");
        }
        let there = faults.to_believed([5.0, 1.0, 0.0]);
        let back = faults.to_true([there[0], there[1]]);
        assert!((back[0] - 5.0).abs() < 1e-12 && (back[1] - 1.0).abs() < 1e-12);
        assert!(faults.relocalise() && !faults.relocalise());
        assert_eq!(faults.to_believed(pose), pose);
    }
}
