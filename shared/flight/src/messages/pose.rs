//! Poses in the plane as those of space.

use crate::cdr::Cdr;

/// A pose in the plane.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct PlanarPose {
    /// m.
    pub(crate) x: f64,
    /// m.
    pub(crate) y: f64,
    /// rad, counter-clockwise.
    pub(crate) yaw: f64,
}

impl PlanarPose {
    /// Position and quaternion: both `geometry_msgs/Pose` and `geometry_msgs/Transform`.
    pub(crate) fn encode(self, cdr: &mut Cdr) {
        cdr.f64_array(&[self.x, self.y, 0.0]);
        let (sin, cos) = (0.5 * self.yaw).sin_cos();
        cdr.f64_array(&[0.0, 0.0, sin, cos]);
    }
}
