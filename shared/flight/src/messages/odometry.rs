//! Where a robot is, and how it moves.

use crate::cdr::Cdr;
use crate::messages::header::Header;
use crate::messages::message::Message;
use crate::messages::pose::PlanarPose;

/// First element of a covariance: nothing is known of what it belongs to, by the convention of
/// ROS messages.
const UNKNOWN: f64 = -1.0;
/// Rows and columns of a covariance.
const DIMENSIONS: usize = 6;

/// A velocity in the plane; what is not measured is 0 with variance -1.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct PlanarTwist {
    /// Forward and lateral, m/s.
    pub(crate) linear: Option<[f64; 2]>,
    /// Yaw rate, rad/s.
    pub(crate) yaw_rate: Option<f64>,
}

/// `nav_msgs/msg/Odometry`, of a robot in the plane.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Odometry<'a> {
    pub(crate) header: Header<'a>,
    pub(crate) child: &'a str,
    pub(crate) pose: PlanarPose,
    pub(crate) twist: PlanarTwist,
}

impl PlanarTwist {
    fn encode(self, cdr: &mut Cdr) {
        let [forward, lateral] = self.linear.unwrap_or_default();
        let yaw_rate = self.yaw_rate.unwrap_or_default();
        cdr.f64_array(&[forward, lateral, 0.0, 0.0, 0.0, yaw_rate]);
        let mut covariance = [[0.0; DIMENSIONS]; DIMENSIONS];
        if self.linear.is_none() {
            (covariance[0][0], covariance[1][1]) = (UNKNOWN, UNKNOWN);
        }
        if self.yaw_rate.is_none() {
            covariance[DIMENSIONS - 1][DIMENSIONS - 1] = UNKNOWN;
        }
        cdr.f64_array(covariance.as_flattened());
    }
}

impl Message for Odometry<'_> {
    fn encode(&self, cdr: &mut Cdr) {
        self.header.encode(cdr);
        cdr.text(self.child);
        self.pose.encode(cdr);
        cdr.f64_array(&[0.0; DIMENSIONS * DIMENSIONS]);
        self.twist.encode(cdr);
    }
}
