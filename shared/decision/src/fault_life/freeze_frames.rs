//! The last seconds of frames, for what was measured when a fault began.

use vigil_blocks::{CHANNELS, COMMANDS, FaultRecord, SensorFrame};
use vigil_checkpoint::{Checkpoint, CheckpointValue};

/// Frames that are kept, and the least time between two of them, ns: five seconds.
const FRAMES: usize = 512;
const INTERVAL_NS: u64 = 10_000_000;

#[derive(Debug, Clone, Copy, CheckpointValue)]
struct KeptFrame {
    t_capture_ns: u64,
    channel_valid: u64,
    channel: [f64; CHANNELS],
    command_valid: u32,
    command: [f64; COMMANDS],
}

/// A ring of frames.
#[derive(Checkpoint)]
pub(super) struct FreezeFrames {
    /// All there from the beginning, so that no page is touched first in a cycle.
    #[checkpoint(each)]
    ring: Vec<KeptFrame>,
    /// Frames in it, and the place of the next.
    count: usize,
    next: usize,
    newest_ns: u64,
    epoch: u64,
}

impl FreezeFrames {
    pub(super) fn new() -> Self {
        let none = KeptFrame {
            t_capture_ns: 0,
            channel_valid: 0,
            channel: [0.0; CHANNELS],
            command_valid: 0,
            command: [0.0; COMMANDS],
        };
        Self {
            ring: vec![none; FRAMES],
            count: 0,
            next: 0,
            newest_ns: 0,
            epoch: 0,
        }
    }

    /// Keeps a frame, unless the last one is as good.
    pub(super) fn push(&mut self, frame: &SensorFrame) {
        let t_capture_ns = frame.header.t_capture_ns;
        // Another publisher, or a clock that was set back, begins anew.
        if frame.header.epoch != self.epoch || t_capture_ns < self.newest_ns {
            (self.count, self.next) = (0, 0);
        }
        self.epoch = frame.header.epoch;
        if self.count > 0 && t_capture_ns - self.newest_ns < INTERVAL_NS {
            return;
        }
        let kept = KeptFrame {
            t_capture_ns,
            channel_valid: frame.channel_valid,
            channel: frame.channel,
            command_valid: frame.command_valid,
            command: frame.command,
        };
        self.ring[self.next] = kept;
        self.count = (self.count + 1).min(FRAMES);
        self.next = (self.next + 1) % FRAMES;
        self.newest_ns = t_capture_ns;
    }

    /// Writes the frame nearest to an instant into a record, or the newest if none is known;
    /// nothing before the first frame.
    pub(super) fn freeze(&self, t_capture_ns: Option<u64>, record: &mut FaultRecord) {
        let wanted_ns = t_capture_ns.unwrap_or(self.newest_ns);
        let kept = self.ring.iter().take(self.count);
        let nearest = kept.min_by_key(|kept| kept.t_capture_ns.abs_diff(wanted_ns));
        if let Some(kept) = nearest {
            record.frame_t_capture_ns = kept.t_capture_ns;
            (record.channel_valid, record.channel) = (kept.channel_valid, kept.channel);
            (record.command_valid, record.command) = (kept.command_valid, kept.command);
        }
    }
}
