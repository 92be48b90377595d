//! A line of a log.

use crate::cdr::Cdr;
use crate::messages::header::Stamp;
use crate::messages::message::Message;

/// How grave a line is, in the codes of ROS 2.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(u8)]
pub(crate) enum LogLevel {
    /// Only programs read it.
    Debug = 10,
    /// As it should be.
    Info = 20,
    /// Less reserve than there should be.
    Warn = 30,
    /// Something is broken.
    Error = 40,
    /// A service has ended.
    Fatal = 50,
}

/// `rcl_interfaces/msg/Log`, from no file.
#[derive(Debug, Clone, Copy)]
pub(crate) struct LogLine<'a> {
    pub(crate) stamp: Stamp,
    pub(crate) level: LogLevel,
    /// Who says it.
    pub(crate) name: &'a str,
    pub(crate) text: &'a str,
}

impl Message for LogLine<'_> {
    fn encode(&self, cdr: &mut Cdr) {
        self.stamp.encode(cdr);
        cdr.u8(self.level as u8);
        cdr.text(self.name);
        cdr.text(self.text);
        cdr.text("");
        cdr.text("");
        cdr.u32(0);
    }
}
