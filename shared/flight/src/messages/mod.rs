//! Messages of ROS 2, as far as flights hold them.

pub(crate) mod diagnostics;
pub(crate) mod header;
pub(crate) mod joint_state;
pub(crate) mod log;
pub(crate) mod message;
pub(crate) mod odometry;
pub(crate) mod pose;
pub(crate) mod text;
pub(crate) mod transform;
