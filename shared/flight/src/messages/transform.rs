//! Where one frame lies in another.

use crate::cdr::Cdr;
use crate::messages::header::Header;
use crate::messages::message::Message;
use crate::messages::pose::PlanarPose;

/// `tf2_msgs/msg/TFMessage` with one transform.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Transform<'a> {
    /// Its frame is the parent.
    pub(crate) header: Header<'a>,
    pub(crate) child: &'a str,
    pub(crate) pose: PlanarPose,
}

impl Message for Transform<'_> {
    fn encode(&self, cdr: &mut Cdr) {
        cdr.count(1);
        self.header.encode(cdr);
        cdr.text(self.child);
        self.pose.encode(cdr);
    }
}
