//! What is true of a simulated robot.

use vigil_blocks::Truth;

use crate::message_times::MessageTimes;
use crate::messages::header::{Header, Stamp};
use crate::messages::odometry::{Odometry, PlanarTwist};
use crate::messages::pose::PlanarPose;
use crate::sink::Sink;
use crate::topics;

/// Writes where the robot really is. A simulator's pose sensor measures in the world's own frame,
/// so that both poses lie in one picture.
pub(crate) fn write_truth<S: Sink>(
    truth: &Truth,
    times: MessageTimes,
    sink: &mut S,
) -> Result<(), S::Error> {
    let [x, y, yaw] = truth.pose;
    let [forward, lateral, yaw_rate] = truth.velocity;
    let odometry = Odometry {
        header: Header {
            stamp: Stamp {
                unix_ns: times.capture_ns,
            },
            frame: "odom",
        },
        child: "base_link_truth",
        pose: PlanarPose { x, y, yaw },
        twist: PlanarTwist {
            linear: Some([forward, lateral]),
            yaw_rate: Some(yaw_rate),
        },
    };
    sink.write(&topics::TRUTH, times, &odometry)
}
