//! What an external publisher's frames look like to Vigil.

mod content;
mod listen;
mod refused;
mod timing;
mod transport;

use vigil_blocks::{REJECTIONS, SensorFrame};
use vigil_setup::Setup;

use crate::findings::Finding;

pub use listen::listen;

/// A frame, and when it arrived.
#[derive(Debug, Clone)]
pub struct Arrived {
    /// `CLOCK_MONOTONIC` ns.
    pub now_ns: u64,
    /// The frame as it came.
    pub frame: SensorFrame,
}

/// All that came while somebody listened.
#[derive(Debug, Clone, Default)]
pub struct Heard {
    /// Frames in the order of arrival, at most [`listen::FRAMES_MAX`].
    pub frames: Vec<Arrived>,
    /// Frames beyond those.
    pub more: u64,
    /// How long was listened, s.
    pub seconds: f64,
    /// True if a graph was running, false if this program listened in its place.
    pub is_graph_running: bool,
    /// Frames that the running graph refused meanwhile, by cause; without a graph, what one would
    /// have refused.
    pub rejected: [u64; REJECTIONS],
}

/// Everything that can be said about it.
pub fn findings(setup: &Setup, heard: &Heard) -> Vec<Finding> {
    let mut all = transport::findings(setup, heard);
    all.extend(refused::findings(heard));
    if heard.frames.is_empty() {
        return all;
    }
    all.extend(timing::findings(setup.file.graph.rate_hz, heard));
    all.extend(content::findings(&setup.robot, &heard.frames));
    all
}
