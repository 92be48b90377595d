//! The last seconds of frames, for what was measured when a fault began.

use vigil_blocks::{CHANNELS, COMMANDS, FaultRecord, SensorFrame};

/// Frames that are kept, and the least time between two of them, ns: five seconds.
const FRAMES: usize = 512;
const INTERVAL_NS: u64 = 10_000_000;

#[derive(Debug, Clone, Copy)]
struct KeptFrame {
    t_capture_ns: u64,
    channel_valid: u64,
    channel: [f64; CHANNELS],
    command_valid: u32,
    command: [f64; COMMANDS],
}

/// A ring of frames.
pub(super) struct FreezeFrames {
    ring: Vec<KeptFrame>,
    next: usize,
    newest_ns: u64,
}

impl FreezeFrames {
    pub(super) fn new() -> Self {
        Self {
            ring: Vec::with_capacity(FRAMES),
            next: 0,
            newest_ns: 0,
        }
    }

    /// Keeps a frame, unless the last one is as good.
    pub(super) fn push(&mut self, frame: &SensorFrame) {
        let t_capture_ns = frame.header.t_capture_ns;
        // A clock that was set back begins anew.
        let is_soon = t_capture_ns >= self.newest_ns
            && t_capture_ns - self.newest_ns < INTERVAL_NS
            && !self.ring.is_empty();
        if is_soon {
            return;
        }
        let kept = KeptFrame {
            t_capture_ns,
            channel_valid: frame.channel_valid,
            channel: frame.channel,
            command_valid: frame.command_valid,
            command: frame.command,
        };
        match self.ring.get_mut(self.next) {
            Some(place) => *place = kept,
            None => self.ring.push(kept),
        }
        self.next = (self.next + 1) % FRAMES;
        self.newest_ns = t_capture_ns;
    }

    /// Writes the frame nearest to an instant into a record; nothing before the first frame.
    pub(super) fn freeze(&self, t_capture_ns: u64, record: &mut FaultRecord) {
        let nearest = self
            .ring
            .iter()
            .min_by_key(|kept| kept.t_capture_ns.abs_diff(t_capture_ns));
        if let Some(kept) = nearest {
            record.frame_t_capture_ns = kept.t_capture_ns;
            (record.channel_valid, record.channel) = (kept.channel_valid, kept.channel);
            (record.command_valid, record.command) = (kept.command_valid, kept.command);
        }
    }
}
