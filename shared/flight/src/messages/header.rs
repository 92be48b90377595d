//! When a message was, and in which frame.

use crate::cdr::Cdr;

const NS_PER_S: u64 = 1_000_000_000;

/// `builtin_interfaces/Time`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Stamp {
    /// Since 1970, ns.
    pub(crate) unix_ns: u64,
}

impl Stamp {
    /// Seconds and nanoseconds; the last instant that the seconds can say stands for later ones.
    pub(crate) fn encode(self, cdr: &mut Cdr) {
        cdr.i32(i32::try_from(self.unix_ns / NS_PER_S).unwrap_or(i32::MAX));
        cdr.u32((self.unix_ns % NS_PER_S) as u32);
    }
}

/// `std_msgs/Header`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Header<'a> {
    /// When the data was captured.
    pub(crate) stamp: Stamp,
    /// Frame in which it is given; empty if that has no meaning.
    pub(crate) frame: &'a str,
}

impl Header<'_> {
    /// One without a frame.
    pub(crate) const fn at(unix_ns: u64) -> Self {
        Self {
            stamp: Stamp { unix_ns },
            frame: "",
        }
    }

    pub(crate) fn encode(&self, cdr: &mut Cdr) {
        self.stamp.encode(cdr);
        cdr.text(self.frame);
    }
}
