//! What every message can do.

use crate::cdr::Cdr;

/// A message of ROS 2.
pub(crate) trait Message {
    /// Writes its fields, in the order of the definition of its topic's type.
    fn encode(&self, cdr: &mut Cdr);
}
