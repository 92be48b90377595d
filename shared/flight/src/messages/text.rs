//! A text alone.

use crate::cdr::Cdr;
use crate::definitions::{Definition, STRING};
use crate::messages::message::Message;

/// `std_msgs/msg/String`.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Text<'a> {
    pub(crate) data: &'a str,
}

impl Message for Text<'_> {
    const DEFINITION: &'static Definition = &STRING;

    fn encode(&self, cdr: &mut Cdr) {
        cdr.text(self.data);
    }
}
