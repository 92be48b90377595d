//! A service's journal: what its step took, published after each turn; and now and then its state.

use vigil_blocks::{
    Block, BlockId, CHECKPOINT_BYTES, CheckpointPart, JOURNAL_ENTRIES, Journal, JournalEntry,
    JournalKind, STATE_BYTES_MAX,
};
use vigil_checkpoint::{Checkpoint, CheckpointError, CheckpointWriter};

use crate::clock::Clock;
use crate::port::{Graph, Sender, Stamp};
use crate::port_error::PortError;
use crate::topic::{ServiceName, Topic};

/// Time between two states that are handed out, ns. All services do it at the same instants of the
/// schedule. Chosen: a recording can be computed again from its first ten seconds on.
const CHECKPOINT_PERIOD_NS: u64 = 10_000_000_000;
/// Entries of a turn at most: more than queues hold by default.
const ENTRIES_MAX: usize = 1024;

/// Publishes what a step took. Nothing here is on the way from input to output.
pub struct JournalWriter {
    journal: Box<dyn Sender<Journal>>,
    parts: Box<dyn Sender<CheckpointPart>>,
    /// Of this turn.
    entries: Vec<JournalEntry>,
    lost: u32,
    /// What was published in this turn, and after how many entries.
    answer: Option<(BlockId, usize)>,
    /// Room for a state.
    room: Box<[u8]>,
    /// The state that is being handed out.
    state: Option<SavedState>,
    /// Which of the periods the last state was handed out in.
    period: Option<u64>,
}

/// A state that is being handed out.
#[derive(Debug, Clone, Copy)]
struct SavedState {
    /// The journal's block after which it was so.
    after: BlockId,
    bytes: usize,
    sent: usize,
}

impl JournalWriter {
    /// Opens the journal of `service`, whose step has just begun.
    ///
    /// # Errors
    /// The transport's.
    pub fn open(graph: &Graph, service: ServiceName) -> Result<Self, PortError> {
        let mut entries = Vec::with_capacity(ENTRIES_MAX);
        entries.push(JournalEntry::new(JournalKind::Begun, 0));
        Ok(Self {
            journal: graph.sender(Topic::Journal(service))?,
            parts: graph.sender(Topic::Checkpoint(service))?,
            entries,
            lost: 0,
            answer: None,
            room: vec![0; STATE_BYTES_MAX].into_boxed_slice(),
            state: None,
            period: None,
        })
    }

    /// Notes what the step has taken. Refused frames that follow each other make one entry.
    pub fn note(&mut self, entry: JournalEntry) {
        let is_refused = |kind: u32| kind == JournalKind::Refused as u32;
        let first = self.answer.map_or(0, |(_, until)| until);
        let last = self.entries.get_mut(first..).and_then(<[_]>::last_mut);
        let last = last.filter(|last| is_refused(last.kind) && is_refused(entry.kind));
        if let Some(last) = last {
            last.count = last.count.saturating_add(entry.count);
        } else if self.entries.len() == ENTRIES_MAX {
            self.lost = self.lost.saturating_add(1);
        } else {
            self.entries.push(entry);
        }
    }

    /// Notes what is published of what was taken so far.
    pub fn answer<T: Block>(&mut self, sender: &dyn Sender<T>) {
        let (epoch, seq) = (sender.epoch(), sender.next_seq());
        self.answer = Some((BlockId { epoch, seq }, self.entries.len()));
    }

    /// Publishes the turn, and a part of the state if one is due. Allocates nothing.
    ///
    /// # Errors
    /// The transport's.
    pub fn publish(
        &mut self,
        state: &impl Checkpoint,
        stamp: Stamp,
        clock: &dyn Clock,
    ) -> Result<(), PortError> {
        self.send_entries((stamp, clock))?;
        self.journal.prepare()?;
        if let Some(state) = self.state.take() {
            return self.send_part(state, (stamp, clock));
        }
        let period = stamp.t_schedule_ns / CHECKPOINT_PERIOD_NS;
        let before = self.period.replace(period);
        if before.is_some_and(|before| before != period) {
            self.save(state);
        }
        Ok(())
    }

    fn send_entries(&mut self, (stamp, clock): (Stamp, &dyn Clock)) -> Result<(), PortError> {
        let mut sent = 0;
        while sent < self.entries.len() || self.answer.is_some() {
            let rest = &self.entries[sent..];
            let now = &rest[..rest.len().min(JOURNAL_ENTRIES)];
            let block = self.journal.block();
            block.lost = self.lost;
            block.count = now.len() as u32;
            block.entries[..now.len()].copy_from_slice(now);
            // In the block that holds the last entry before it.
            if let Some((id, until)) = self.answer.take_if(|(_, until)| *until <= sent + now.len())
            {
                (block.answer_epoch, block.answer_seq) = (id.epoch, id.seq);
                block.answered = (until - sent) as u32;
            }
            sent += now.len();
            self.journal.send(stamp, clock)?;
        }
        self.entries.clear();
        Ok(())
    }

    /// Keeps the state as it is now, to be handed out part by part.
    fn save(&mut self, state: &impl Checkpoint) {
        let mut writer = CheckpointWriter::new(&mut self.room);
        state.save(&mut writer);
        let bytes = match writer.finish() {
            Ok(bytes) | Err(CheckpointError::Full { bytes, .. }) => bytes,
            Err(_) => return,
        };
        let seq = self.journal.next_seq().saturating_sub(1);
        let epoch = self.journal.epoch();
        self.state = Some(SavedState {
            after: BlockId { epoch, seq },
            bytes,
            sent: 0,
        });
    }

    fn send_part(
        &mut self,
        mut state: SavedState,
        (stamp, clock): (Stamp, &dyn Clock),
    ) -> Result<(), PortError> {
        // One that is too large has a single part, which is empty and says its size.
        let whole = self.room.get(..state.bytes).unwrap_or_default();
        let rest = &whole[state.sent.min(whole.len())..];
        let bytes = &rest[..rest.len().min(CHECKPOINT_BYTES)];
        let part = self.parts.block();
        (part.journal_epoch, part.journal_seq) = (state.after.epoch, state.after.seq);
        part.whole = state.bytes as u32;
        (part.offset, part.size) = (state.sent as u32, bytes.len() as u32);
        part.bytes[..bytes.len()].copy_from_slice(bytes);
        state.sent += bytes.len();
        if state.sent < whole.len() {
            self.state = Some(state);
        }
        self.parts.send(stamp, clock).map(drop)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::clock::VirtualClock;
    use crate::port::{Bus, Receiver};

    const SERVICE: ServiceName = ServiceName::Detector;

    /// A writer, and what it publishes.
    fn journal() -> (JournalWriter, Box<dyn Receiver<Journal>>, Graph) {
        let graph = Graph::InProcess(Bus::new(VirtualClock::default()));
        let received = graph.receiver(Topic::Journal(SERVICE)).unwrap();
        let writer = JournalWriter::open(&graph, SERVICE).unwrap();
        (writer, received, graph)
    }

    fn stamp(t_schedule_ns: u64) -> Stamp {
        Stamp {
            t_schedule_ns,
            t_capture_ns: 0,
        }
    }

    #[test]
    fn a_turn_says_what_was_taken_before_its_answer_and_after() {
        let (mut writer, mut received, graph) = journal();
        let sender = graph.sender::<vigil_blocks::Truth>(Topic::Truth).unwrap();
        let clock = VirtualClock::default();
        for count in 0..10 {
            writer.note(JournalEntry::new(JournalKind::Missed, count));
        }
        writer.answer(&*sender);
        writer.note(JournalEntry::new(JournalKind::Budget, 5));
        writer.publish(&0_u64, stamp(0), &clock).unwrap();
        let mut blocks = Vec::new();
        while let Some(block) = received.take_next() {
            let (before, after) = block.around_answer();
            let first = block.used()[0].kind;
            let answer = block.answer().map(|id| id.seq);
            blocks.push((first, before.len(), answer, after.len()));
        }
        let (begun, missed) = (JournalKind::Begun as u32, JournalKind::Missed as u32);
        assert_eq!(blocks, [(begun, 8, None, 0), (missed, 3, Some(0), 1)]);
        writer.answer(&*sender);
        writer.publish(&0_u64, stamp(0), &clock).unwrap();
        let block = received.take_next().unwrap();
        assert!(block.used().is_empty() && block.answer().is_some());
        writer.publish(&0_u64, stamp(0), &clock).unwrap();
        assert!(
            received.take_next().is_none(),
            "a turn without entries is silent"
        );
    }

    /// The parts that 35 turns publish, ten in each period.
    fn parts_of(state: &impl Checkpoint) -> Vec<CheckpointPart> {
        let (mut writer, _, graph) = journal();
        let topic = Topic::Checkpoint(SERVICE);
        let mut received = graph.receiver::<CheckpointPart>(topic).unwrap();
        let (clock, mut parts) = (VirtualClock::default(), Vec::new());
        for turn in 0..35 {
            writer.note(JournalEntry::new(JournalKind::Missed, turn));
            let t_ns = u64::from(turn) * CHECKPOINT_PERIOD_NS / 10;
            writer.publish(state, stamp(t_ns), &clock).unwrap();
            while let Some(part) = received.take_next() {
                parts.push(*part);
            }
        }
        parts
    }

    #[test]
    fn the_state_goes_out_in_parts_once_a_period() {
        let state: Vec<u64> = (0..3000).collect();
        let parts = parts_of(&state);
        let after: Vec<u64> = parts.iter().map(|part| part.journal_seq).collect();
        assert_eq!(after, [10, 10, 20, 20, 30, 30]);
        for whole in parts.chunks(2) {
            let bytes = whole
                .iter()
                .flat_map(|part| &part.bytes[..part.size as usize]);
            let bytes: Vec<u8> = bytes.copied().collect();
            assert_eq!(whole[1].offset, whole[0].size);
            assert_eq!(whole[0].whole as usize, bytes.len());
            let mut loaded = Vec::<u64>::new();
            let mut reader = vigil_checkpoint::CheckpointReader::new(&bytes);
            loaded.load(&mut reader);
            assert_eq!((reader.finish(), &loaded), (Ok(()), &state));
        }
    }

    #[test]
    fn a_state_that_is_too_large_says_its_size() {
        let state = vec![0_u64; STATE_BYTES_MAX / 8];
        let parts = parts_of(&state);
        let said: Vec<_> = parts.iter().map(|part| (part.offset, part.size)).collect();
        assert_eq!(said, [(0, 0); 3]);
        assert!(
            parts
                .iter()
                .all(|part| part.whole as usize == STATE_BYTES_MAX + 4)
        );
    }

    #[test]
    fn refused_frames_in_a_row_are_one_entry() {
        let (mut writer, mut received, _) = journal();
        for _ in 0..200 {
            writer.note(JournalEntry::new(JournalKind::Refused, 1));
        }
        let clock = VirtualClock::default();
        writer.publish(&0_u64, stamp(0), &clock).unwrap();
        let block = received.take_next().unwrap();
        assert_eq!((block.used().len(), block.used()[1].count), (2, 200));
    }

    #[test]
    fn entries_without_room_are_counted() {
        let (mut writer, mut received, _) = journal();
        for _ in 0..ENTRIES_MAX + 4 {
            writer.note(JournalEntry::new(JournalKind::Missed, 0));
        }
        let clock = VirtualClock::default();
        writer.publish(&0_u64, stamp(0), &clock).unwrap();
        let mut lost = 0;
        while let Some(block) = received.take_next() {
            lost = block.lost;
        }
        assert_eq!(lost, 5);
    }
}
