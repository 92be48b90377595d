//! What has happened to the robot.

use vigil_robot::kinematics::wrap_angle;
use vigil_setup::schema::{Trouble, TroubleKind};

/// Troubles that are due, and what they have done.
#[derive(Debug, Clone)]
pub(super) struct Troubles {
    to_come: Vec<Trouble>,
    /// Rotation, rad, about `pivot`, then a shift, m: from true to believed poses.
    lost: Option<Jump>,
    /// The robot takes the path's direction turned by so much, rad.
    pub(super) wrong_heading_rad: f64,
    /// The range sensor sees nothing.
    pub(super) is_blind: bool,
    /// Where the range sensor sees what is not there.
    pub(super) phantom: Option<[f64; 2]>,
}

/// A rigid motion of the believed frame.
#[derive(Debug, Clone, Copy)]
struct Jump {
    pivot: [f64; 2],
    yaw_rad: f64,
    shift_m: [f64; 2],
}

impl Troubles {
    pub(super) fn new(troubles: &[Trouble]) -> Self {
        let mut to_come = troubles.to_vec();
        to_come.sort_by(|a, b| b.at_s.total_cmp(&a.at_s));
        Self {
            to_come,
            lost: None,
            wrong_heading_rad: 0.0,
            is_blind: false,
            phantom: None,
        }
    }

    /// What is due at `t_s` happens to a robot at the true `pose`.
    pub(super) fn strike(&mut self, t_s: f64, pose: [f64; 3]) {
        while self.to_come.last().is_some_and(|next| next.at_s <= t_s) {
            let Some(trouble) = self.to_come.pop() else {
                break;
            };
            match trouble.kind {
                TroubleKind::Mislocalised => {
                    self.lost = Some(Jump {
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

    /// What the robot takes for its pose when it is at `pose`.
    pub(super) fn believed(&self, pose: [f64; 3]) -> [f64; 3] {
        self.lost.map_or(pose, |jump| {
            let (sin, cos) = jump.yaw_rad.sin_cos();
            let (x, y) = (pose[0] - jump.pivot[0], pose[1] - jump.pivot[1]);
            [
                jump.pivot[0] + jump.shift_m[0] + cos * x - sin * y,
                jump.pivot[1] + jump.shift_m[1] + sin * x + cos * y,
                wrap_angle(pose[2] + jump.yaw_rad),
            ]
        })
    }

    /// Where a place of the believed frame truly is.
    pub(super) fn truly(&self, place: [f64; 2]) -> [f64; 2] {
        self.lost.map_or(place, |jump| {
            let (sin, cos) = jump.yaw_rad.sin_cos();
            let x = place[0] - jump.pivot[0] - jump.shift_m[0];
            let y = place[1] - jump.pivot[1] - jump.shift_m[1];
            [
                jump.pivot[0] + cos * x + sin * y,
                jump.pivot[1] - sin * x + cos * y,
            ]
        })
    }

    /// The robot finds its place; true if its believed frame jumps.
    pub(super) const fn find_place(&mut self) -> bool {
        self.wrong_heading_rad = 0.0;
        self.lost.take().is_some()
    }

    /// A person mends the sensor.
    pub(super) const fn mend_sensor(&mut self) {
        self.is_blind = false;
        self.phantom = None;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_jump_and_its_reverse_cancel_out() {
        let mut troubles = Troubles::new(&[
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
        troubles.strike(1.9, pose);
        assert_eq!(troubles.believed(pose), pose);
        troubles.strike(2.0, pose);
        assert!(!troubles.is_blind);
        let believed = troubles.believed(pose);
        for (found, expected) in believed.iter().zip([4.0, -0.3, 0.4]) {
            assert!((found - expected).abs() < 1e-12, "{believed:?}");
        }
        let there = troubles.believed([5.0, 1.0, 0.0]);
        let back = troubles.truly([there[0], there[1]]);
        assert!((back[0] - 5.0).abs() < 1e-12 && (back[1] - 1.0).abs() < 1e-12);
        assert!(troubles.find_place() && !troubles.find_place());
        assert_eq!(troubles.believed(pose), pose);
    }
}
