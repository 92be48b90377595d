//! Journal entries: the only input of a service's `step`, and how they are published.

use strum::FromRepr;

use crate::block::block;
use crate::header::{BlockId, Header};
use crate::layout::part;

/// What a `step` is told. The same sequence of entries and the same seed give bit-identical
/// beliefs, live, in replay, in evaluation and in tests.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Entry<I> {
    /// New input.
    Frame(I),
    /// The deadline passed this many times without input: publish a prediction. The filter's state
    /// stays at the last frame, so that a late frame is folded in exactly.
    Missed(u32),
    /// From now on use at most this many particles or hypotheses.
    Budget(u32),
    /// Forget everything: a new run begins.
    Reset,
}

/// The block of this name; epoch 0 stands for none.
fn named(epoch: u64, seq: u64) -> Option<BlockId> {
    (epoch != 0).then_some(BlockId { epoch, seq })
}

/// Entries in a block.
pub const JOURNAL_ENTRIES: usize = 8;

/// Bytes of a state in a block.
pub const CHECKPOINT_BYTES: usize = 16_384;
/// Bytes of a whole state at most.
pub const STATE_BYTES_MAX: usize = 2 << 20;

/// What a [`JournalEntry`] says.
#[derive(Debug, Clone, Copy, PartialEq, Eq, FromRepr)]
#[repr(u32)]
pub enum JournalKind {
    /// The service has begun: its state is that of the configuration.
    Begun = 1,
    /// [`Entry::Frame`]: input and, where there is one, the detection beside it.
    Frame = 2,
    /// [`Entry::Missed`]; `count` periods.
    Missed = 3,
    /// [`Entry::Budget`]; `count` particles or hypotheses.
    Budget = 4,
    /// [`Entry::Reset`].
    Reset = 5,
    /// Frames were refused at the border; `count` of them.
    Refused = 6,
    /// A detection was seen for its blindness alone.
    Looked = 7,
    /// The faults go on from those that an earlier supervisor has left; `input` names the block
    /// that says them.
    Restored = 8,
    /// A frame was kept, for what is measured when a fault begins.
    Kept = 9,
    /// The faults have lived until `t_ns`; `count` says as bits, in the order of the data, which
    /// services were silent.
    Lived = 10,
    /// An operator's order about faults was taken at `t_ns`: `count` is its
    /// [`ControlCommand`](crate::ControlCommand), `fault` what it asks about.
    Ordered = 11,
    /// The faults were published; `input` names the block.
    Told = 12,
}

part! {
/// One entry of a service's journal. Blocks are named, not repeated: they stand in their topics.
#[derive(Eq)]
pub struct JournalEntry, size 56 {
    /// A [`JournalKind`].
    pub kind: u32,
    /// Periods that were missed, particles that are allowed, frames that were refused, services
    /// that were silent, the command of an order.
    pub count: u32,
    /// The input: a sensor frame; for the supervisor a diagnosis, or what the kind says. Epoch 0
    /// stands for none.
    pub input_epoch: u64,
    /// See `input_epoch`.
    pub input_seq: u64,
    /// The detection that was taken with it. Epoch 0 stands for none.
    pub detection_epoch: u64,
    /// See `detection_epoch`.
    pub detection_seq: u64,
    /// When it was, on `CLOCK_MONOTONIC`, ns; 0 where time has no effect.
    pub t_ns: u64,
    /// The blindness that the detection was taken with, which a later prediction may have said.
    pub blind: u32,
    /// The fault that an order is about, by its number; 0 for all.
    pub fault: u32,
}
}

impl JournalEntry {
    /// An entry without input.
    #[must_use]
    pub fn new(kind: JournalKind, count: u32) -> Self {
        Self {
            kind: kind as u32,
            count,
            ..Self::default()
        }
    }

    /// The same entry with this input.
    #[must_use]
    pub const fn with_input(mut self, id: BlockId) -> Self {
        (self.input_epoch, self.input_seq) = (id.epoch, id.seq);
        self
    }

    /// The same entry at this time.
    #[must_use]
    pub const fn at(mut self, t_ns: u64) -> Self {
        self.t_ns = t_ns;
        self
    }

    /// The same entry about this fault.
    #[must_use]
    pub const fn about(mut self, fault: u32) -> Self {
        self.fault = fault;
        self
    }

    /// The same entry with this detection, taken as `blind` says.
    #[must_use]
    pub const fn with_detection(mut self, id: BlockId, blind: u32) -> Self {
        (self.detection_epoch, self.detection_seq) = (id.epoch, id.seq);
        self.blind = blind;
        self
    }

    /// The input, if there is one.
    #[must_use]
    pub fn input(&self) -> Option<BlockId> {
        named(self.input_epoch, self.input_seq)
    }

    /// The detection, if there is one.
    #[must_use]
    pub fn detection(&self) -> Option<BlockId> {
        named(self.detection_epoch, self.detection_seq)
    }
}

block! {
    /// What a service's step took in one turn, in order, and which block it published then. A turn
    /// of more entries takes several blocks.
    pub struct Journal, size 528 {
        /// Common header.
        pub header: Header,
        /// Epoch of the belief or action that was published after `answered` entries; 0 for none.
        pub answer_epoch: u64,
        /// Its sequence number.
        pub answer_seq: u64,
        /// Entries that were lost since the service began, for want of room.
        pub lost: u32,
        /// Entries in use.
        pub count: u32,
        /// Entries that were taken before the answer.
        pub answered: u32,
        /// Reserved, zero.
        pub reserved: u32,
        /// The entries.
        pub entries: [JournalEntry; JOURNAL_ENTRIES],
    }
}

impl Journal {
    /// The entries in use.
    #[must_use]
    pub fn used(&self) -> &[JournalEntry] {
        &self.entries[..(self.count as usize).min(JOURNAL_ENTRIES)]
    }

    /// The entries before the answer, and those after it; all are before it if there is none.
    #[must_use]
    pub fn around_answer(&self) -> (&[JournalEntry], &[JournalEntry]) {
        let used = self.used();
        let answered = match self.answer() {
            Some(_) => (self.answered as usize).min(used.len()),
            None => used.len(),
        };
        used.split_at(answered)
    }

    /// The block that was published after `answered` entries, if there is one.
    #[must_use]
    pub fn answer(&self) -> Option<BlockId> {
        named(self.answer_epoch, self.answer_seq)
    }
}

block! {
    /// A part of a service's state, from which a replay can go on.
    pub struct CheckpointPart, size 16464 {
        /// Common header.
        pub header: Header,
        /// The state is that after this block of the journal: its epoch.
        pub journal_epoch: u64,
        /// Its sequence number.
        pub journal_seq: u64,
        /// Place of this part in the state, bytes.
        pub offset: u32,
        /// Bytes of this part.
        pub size: u32,
        /// Bytes of the whole state. One of more than [`STATE_BYTES_MAX`] is not handed out: then
        /// this is its only part, and empty.
        pub whole: u32,
        /// Reserved, zero.
        pub reserved: u32,
        /// The part.
        pub bytes: [u8; CHECKPOINT_BYTES],
    }
}
