//! How several things are.

use crate::cdr::Cdr;
use crate::definitions::{DIAGNOSTIC_ARRAY, Definition};
use crate::messages::header::Header;
use crate::messages::message::Message;

/// How something is, in the codes of ROS 2.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(u8)]
pub(crate) enum Level {
    /// As it should be.
    Ok = 0,
    /// With less reserve.
    Warn = 1,
    /// Not as it should be.
    Error = 2,
    /// Not known.
    Stale = 3,
}

/// `diagnostic_msgs/DiagnosticStatus`.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Status {
    pub(crate) level: Level,
    /// What it is about; viewers show it after `vigil: `.
    pub(crate) name: String,
    pub(crate) message: String,
    /// Keys and values.
    pub(crate) values: Vec<(&'static str, String)>,
}

/// `diagnostic_msgs/msg/DiagnosticArray`.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Diagnostics<'a> {
    pub(crate) header: Header<'a>,
    /// Name of the robot.
    pub(crate) hardware: &'a str,
    pub(crate) statuses: &'a [Status],
}

impl Message for Diagnostics<'_> {
    const DEFINITION: &'static Definition = &DIAGNOSTIC_ARRAY;

    fn encode(&self, cdr: &mut Cdr) {
        self.header.encode(cdr);
        cdr.count(self.statuses.len());
        for status in self.statuses {
            cdr.u8(status.level as u8);
            cdr.text(&format!("vigil: {}", status.name));
            cdr.text(&status.message);
            cdr.text(self.hardware);
            cdr.count(status.values.len());
            for (key, value) in &status.values {
                cdr.text(key);
                cdr.text(value);
            }
        }
    }
}
