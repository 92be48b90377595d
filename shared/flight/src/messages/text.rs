//! A text alone.

use crate::cdr::Cdr;
use crate::messages::message::Message;

/// `std_msgs/msg/String`.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Text<'a> {
    pub(crate) data: &'a str,
}

impl Message for Text<'_> {
    fn encode(&self, cdr: &mut Cdr) {
        cdr.text(self.data);
    }
}
