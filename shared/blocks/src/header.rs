//! What every block begins with, and what caused it.

use strum::FromRepr;

use crate::layout::part;

part! {
/// First 48 bytes of every block.
///
/// `(epoch, seq)` identifies a block: `seq` restarts at 0 when its writer restarts, `epoch` is
/// then a new one. `t_schedule_ns` and `t_capture_ns` of the sensor frame travel through the whole
/// graph, so that latency is measured from the moment a cycle was due.
#[derive(Eq)]
pub struct Header, size 48 {
    /// Schema hash of the block ([`crate::Block::SCHEMA`]).
    pub schema: u64,
    /// Identity of the writer's start; differs after each restart, never 0 once written.
    pub epoch: u64,
    /// Sequence number of the block under its epoch, from 0.
    pub seq: u64,
    /// Instant at which the sensor cycle behind this block was due, ns, `CLOCK_MONOTONIC`.
    pub t_schedule_ns: u64,
    /// Instant at which the data was captured, ns; the recording's own time in a playback. Only
    /// its differences have meaning.
    pub t_capture_ns: u64,
    /// Instant at which the block was handed to the transport, ns, `CLOCK_MONOTONIC`.
    pub t_publish_ns: u64,
}
}

/// What identifies a block on its topic.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct BlockId {
    /// See [`Header::epoch`].
    pub epoch: u64,
    /// See [`Header::seq`].
    pub seq: u64,
}

impl Header {
    /// What identifies the block.
    #[must_use]
    pub const fn id(&self) -> BlockId {
        BlockId {
            epoch: self.epoch,
            seq: self.seq,
        }
    }
}

part! {
/// Which journal entry a service had taken last when it wrote a block.
#[derive(Eq)]
pub struct Cause, size 24 {
    /// A [`CauseKind`].
    pub kind: u32,
    /// Frames folded into this block (1 if on time), or periods missed.
    pub count: u32,
    /// Epoch of the newest sensor frame taken.
    pub frame_epoch: u64,
    /// Sequence number of the newest sensor frame taken.
    pub frame_seq: u64,
}
}

/// Kind of a journal entry, as carried in [`Cause::kind`].
#[derive(Debug, Clone, Copy, PartialEq, Eq, FromRepr)]
#[repr(u32)]
pub enum CauseKind {
    /// A sensor frame was taken.
    Frame = 1,
    /// The deadline passed without input; the belief is a prediction.
    Missed = 2,
}

impl Cause {
    /// The newest sensor frame taken.
    #[must_use]
    pub const fn frame(&self) -> BlockId {
        BlockId {
            epoch: self.frame_epoch,
            seq: self.frame_seq,
        }
    }

    /// The kind, if it is one that this version knows.
    #[must_use]
    pub const fn kind(&self) -> Option<CauseKind> {
        CauseKind::from_repr(self.kind)
    }
}
