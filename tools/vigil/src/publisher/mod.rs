//! What an external publisher's frames look like to Vigil.

mod command_time;
mod content;
mod listen;
mod meaning;
#[cfg(test)]
mod mistakes;
mod refused;
mod running;
mod timing;
mod transport;

use vigil_blocks::{REJECTIONS, SensorFrame};
use vigil_cycle::port::FoundTopic;
use vigil_setup::Border;

use crate::findings::Finding;

pub use listen::listen;
pub use running::source;

/// A frame, and when it arrived.
#[derive(Debug, Clone)]
pub struct FrameArrival {
    /// `CLOCK_MONOTONIC` ns.
    pub now_ns: u64,
    /// The frame as it came.
    pub frame: SensorFrame,
}

/// All that came while somebody listened.
#[derive(Debug, Clone, Default)]
pub struct Reception {
    /// Frames in the order of arrival, at most [`listen::FRAMES_MAX`].
    pub frames: Vec<FrameArrival>,
    /// Frames beyond those.
    pub more: u64,
    /// Frames that no event announced, though they came through shared memory.
    pub unannounced: u64,
    /// How long was listened, s.
    pub seconds: f64,
    /// True if a graph was running, false if this program listened in its place.
    pub is_graph_running: bool,
    /// The sensor's topic as its first user has made it.
    pub topic: Option<FoundTopic>,
    /// Frames that the running graph refused meanwhile, by cause; without a graph, what one would
    /// have refused.
    pub rejected: [u64; REJECTIONS],
    /// What the graph's border says, where that is known.
    pub border: Option<BorderReport>,
}

impl Reception {
    /// True if most frames came without the event that announces them.
    pub fn is_silent(&self) -> bool {
        2 * self.unannounced > self.frames.len() as u64 + self.more
    }
}

/// What the service at the border of a running graph says of its input.
#[derive(Debug, Clone, Copy)]
pub struct BorderReport {
    /// Period of the schedule, ns.
    pub period_ns: u64,
    /// Frames that got lost on their way to a socket; what goes on from there is numbered anew.
    pub lost_at_socket: Option<u64>,
}

/// Everything that can be said about it.
pub fn findings(border: &Border, heard: &Reception) -> Vec<Finding> {
    let mut all = transport::findings(border, heard);
    all.extend(refused::findings(heard));
    if heard.frames.is_empty() {
        return all;
    }
    let rate_hz = heard.border.map_or(border.file.graph.rate_hz, |border| {
        1e9 / border.period_ns as f64
    });
    all.extend(timing::findings(rate_hz, heard));
    all.extend(content::findings(&border.robot, &heard.frames));
    all
}
