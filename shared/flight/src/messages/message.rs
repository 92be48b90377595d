//! What every message can do.

use crate::cdr::Cdr;
use crate::definitions::Definition;

/// A message of ROS 2.
pub(crate) trait Message {
    /// Its type.
    const DEFINITION: &'static Definition;

    /// Writes its fields, in the order of the definition.
    fn encode(&self, cdr: &mut Cdr);
}
