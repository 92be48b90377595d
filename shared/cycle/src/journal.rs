//! A service's journal: what its step took, published after each turn; and now and then its state.

use vigil_blocks::{
    BlockId, CHECKPOINT_BYTES, CheckpointPart, JOURNAL_ENTRIES, Journal, JournalEntry, JournalKind,
    fnv1a,
};
use vigil_checkpoint::{Checkpoint, CheckpointWriter};

use crate::clock::Clock;
use crate::port::{Graph, Sender, Stamp};
use crate::port_error::PortError;
use crate::topic::{ServiceName, Topic};

/// Time between two states that are handed out, ns. All services do it at the same instants of the
/// schedule. Chosen: a recording can be computed again from its first ten seconds on.
pub const CHECKPOINT_PERIOD_NS: u64 = 10_000_000_000;
/// Entries of a turn at most: more than queues hold by default.
const ENTRIES_MAX: usize = 1024;
/// Bytes of a state at most. Larger ones are not handed out.
const STATE_BYTES_MAX: usize = 2 << 20;

/// Publishes what a step took. Nothing here is on the way from input to output.
pub struct JournalWriter {
    journal: Box<dyn Sender<Journal>>,
    parts: Box<dyn Sender<CheckpointPart>>,
    /// Of this turn.
    entries: Vec<JournalEntry>,
    lost: u32,
    /// What was published in this turn, and after how many entries.
    answer: Option<(BlockId, usize)>,
    /// The state that is being handed out.
    state: Box<[u8]>,
    /// What all its parts say.
    head: CheckpointPart,
    sent: usize,
    /// Which of the periods the last state was handed out in.
    period: Option<u64>,
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
            state: vec![0; STATE_BYTES_MAX].into_boxed_slice(),
            head: CheckpointPart::default(),
            sent: 0,
            period: None,
        })
    }

    /// Notes what the step has taken.
    pub fn note(&mut self, entry: JournalEntry) {
        if self.entries.len() == ENTRIES_MAX {
            self.lost = self.lost.saturating_add(1);
        } else {
            self.entries.push(entry);
        }
    }

    /// Notes what is published of what was taken so far.
    pub fn answer<T: vigil_blocks::Block>(&mut self, sender: &dyn Sender<T>) {
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
        let (answer, until) = self.answer.take().unzip();
        let until = until.unwrap_or(0);
        self.send(0..until, answer, (stamp, clock))?;
        self.send(until..self.entries.len(), None, (stamp, clock))?;
        self.entries.clear();
        let period = stamp.t_schedule_ns / CHECKPOINT_PERIOD_NS;
        if self.sent < self.head.whole as usize {
            self.send_part(stamp, clock)
        } else {
            let before = self.period.replace(period);
            if before.is_some_and(|before| before != period) {
                self.save(state);
            }
            Ok(())
        }
    }

    fn send(
        &mut self,
        entries: std::ops::Range<usize>,
        answer: Option<BlockId>,
        (stamp, clock): (Stamp, &dyn Clock),
    ) -> Result<(), PortError> {
        let mut rest = &self.entries[entries];
        let mut answer = answer;
        while !rest.is_empty() || answer.is_some() {
            let (now, later) = rest.split_at(rest.len().min(JOURNAL_ENTRIES));
            rest = later;
            let block = self.journal.block();
            block.lost = self.lost;
            block.count = now.len() as u32;
            block.entries[..now.len()].copy_from_slice(now);
            if rest.is_empty()
                && let Some(id) = answer.take()
            {
                (block.answer_epoch, block.answer_seq) = (id.epoch, id.seq);
            }
            self.journal.send(stamp, clock)?;
        }
        self.journal.prepare()
    }

    /// Keeps the state as it is now, to be handed out part by part.
    fn save(&mut self, state: &impl Checkpoint) {
        let mut writer = CheckpointWriter::new(&mut self.state);
        state.save(&mut writer);
        let Ok(whole) = writer.finish() else {
            return;
        };
        self.head.hash = fnv1a::hash(fnv1a::BASIS, &self.state[..whole]);
        self.head.whole = whole as u32;
        self.head.journal_epoch = self.journal.epoch();
        self.head.journal_seq = self.journal.next_seq().saturating_sub(1);
        self.sent = 0;
    }

    fn send_part(&mut self, stamp: Stamp, clock: &dyn Clock) -> Result<(), PortError> {
        let rest = &self.state[self.sent..self.head.whole as usize];
        let bytes = &rest[..rest.len().min(CHECKPOINT_BYTES)];
        let part = self.parts.block();
        part.journal_epoch = self.head.journal_epoch;
        part.journal_seq = self.head.journal_seq;
        (part.whole, part.hash) = (self.head.whole, self.head.hash);
        (part.offset, part.size) = (self.sent as u32, bytes.len() as u32);
        part.bytes[..bytes.len()].copy_from_slice(bytes);
        self.sent += bytes.len();
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
            let kinds: Vec<u32> = block.used().iter().map(|entry| entry.kind).collect();
            blocks.push((kinds.len(), kinds[0], block.answer().map(|id| id.seq)));
        }
        let (begun, missed) = (JournalKind::Begun as u32, JournalKind::Missed as u32);
        let budget = JournalKind::Budget as u32;
        assert_eq!(
            blocks,
            [(8, begun, None), (3, missed, Some(0)), (1, budget, None)]
        );
        writer.publish(&0_u64, stamp(0), &clock).unwrap();
        assert!(
            received.take_next().is_none(),
            "a turn without entries is silent"
        );
    }

    #[test]
    fn the_state_goes_out_in_parts_once_a_period() {
        let (mut writer, _, graph) = journal();
        let mut parts = graph
            .receiver::<CheckpointPart>(Topic::Checkpoint(SERVICE))
            .unwrap();
        let clock = VirtualClock::default();
        let state: Vec<u64> = (0..3000).collect();
        let mut bytes = Vec::new();
        for turn in 0..20 {
            let t_ns = turn * CHECKPOINT_PERIOD_NS / 10;
            writer.publish(&state, stamp(t_ns), &clock).unwrap();
            while let Some(part) = parts.take_next() {
                assert_eq!((part.offset as usize, part.journal_seq), (bytes.len(), 0));
                assert_eq!(part.whole as usize, 4 + 8 * state.len());
                bytes.extend_from_slice(&part.bytes[..part.size as usize]);
            }
        }
        let mut loaded = Vec::<u64>::new();
        let mut reader = vigil_checkpoint::CheckpointReader::new(&bytes);
        loaded.load(&mut reader);
        assert_eq!((reader.finish(), loaded), (Ok(()), state));
    }

    #[test]
    fn entries_without_room_are_counted() {
        let (mut writer, mut received, _) = journal();
        for _ in 0..ENTRIES_MAX + 4 {
            writer.note(JournalEntry::new(JournalKind::Refused, 0));
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
