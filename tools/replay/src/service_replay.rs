//! How far the steps of one service are computed again.

use std::collections::VecDeque;

use vigil_blocks::{BlockId, Journal, JournalEntry, JournalKind};
use vigil_cycle::topic::ServiceName;

use crate::checkpoints::Checkpoints;
use crate::step::Step;

/// What became of a service's answers.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Tally {
    /// Answers that the journal tells of.
    pub answers: u64,
    /// Those that were computed again, and whose block was recorded.
    pub compared: u64,
    /// Of the compared answers and states, those that are not the same to the last bit; and entries
    /// at which a step failed that had not failed in the service.
    pub different: u64,
    /// Those that were computed again, and whose block was not recorded.
    pub unrecorded: u64,
    /// States that were compared with what was handed out.
    pub states: u64,
    /// Times at which a service began to be computed: its start, or a state.
    pub begun: u64,
    /// Gaps.
    pub gaps: u64,
}

/// Where a service's step stands.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Standing {
    /// Its state is not known: it waits for its start, or for a state that was handed out.
    Waiting,
    /// Its state is that of the service.
    Following,
}

/// The steps of one service, computed again.
pub(crate) struct ServiceReplay {
    pub(crate) service: ServiceName,
    pub(crate) step: Step,
    pub(crate) standing: Standing,
    pub(crate) checkpoints: Checkpoints,
    /// Blocks of the journal that are to come, each with its time, ns.
    pub(crate) journal: VecDeque<(u64, Journal)>,
    pub(crate) tally: Tally,
    /// The last answer that the journal tells of.
    pub(crate) answered: Option<BlockId>,
    /// The last block of the journal, and the entries that were lost by then.
    last: Option<(BlockId, u32)>,
}

impl ServiceReplay {
    pub(crate) fn new(service: ServiceName, step: Step) -> Self {
        Self {
            service,
            step,
            standing: Standing::Waiting,
            checkpoints: Checkpoints::default(),
            journal: VecDeque::new(),
            tally: Tally::default(),
            answered: None,
            last: None,
        }
    }

    /// Goes on to a block of the journal; what is missing before it.
    pub(crate) fn follow(&mut self, block: &Journal) -> Option<&'static str> {
        let id = block.header.id();
        let last = self.last.replace((id, block.lost));
        let has_begun = block.used().first().is_some_and(begins);
        if has_begun {
            return None;
        }
        match last {
            None => None,
            Some((last, _)) if last.epoch != id.epoch => Some("a start was not recorded"),
            Some((last, _)) if last.seq.checked_add(1) != Some(id.seq) => {
                Some("the journal was not recorded")
            }
            Some((_, lost)) if lost != block.lost => Some("the journal had no room"),
            Some(_) => None,
        }
    }
}

/// True if a service begins with this entry.
pub(crate) fn begins(entry: &JournalEntry) -> bool {
    entry.kind == JournalKind::Begun as u32
}
