//! How several things are.

use crate::cdr::Cdr;
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
    /// What it is about, after `vigil/GRAPH/`; empty: the graph as a whole, `vigil/GRAPH`.
    pub(crate) name: String,
    pub(crate) message: String,
    /// Keys and values.
    pub(crate) values: Vec<(&'static str, String)>,
}

impl Status {
    /// One that is not known, and why.
    pub(crate) fn stale(name: &str, why: &str) -> Self {
        Self {
            level: Level::Stale,
            name: name.to_owned(),
            message: format!("stale: {why}"),
            values: Vec::new(),
        }
    }
}

/// `diagnostic_msgs/msg/DiagnosticArray`.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Diagnostics<'a> {
    pub(crate) header: Header<'a>,
    /// Name of the graph: the hardware id, and part of each name.
    pub(crate) graph: &'a str,
    pub(crate) statuses: &'a [Status],
}

impl Message for Diagnostics<'_> {
    fn encode(&self, cdr: &mut Cdr) {
        self.header.encode(cdr);
        cdr.count(self.statuses.len());
        for status in self.statuses {
            cdr.u8(status.level as u8);
            cdr.text(&match status.name.as_str() {
                "" => format!("vigil/{}", self.graph),
                name => format!("vigil/{}/{name}", self.graph),
            });
            cdr.text(&status.message);
            cdr.text(self.graph);
            cdr.count(status.values.len());
            for (key, value) in &status.values {
                cdr.text(key);
                cdr.text(value);
            }
        }
    }
}
