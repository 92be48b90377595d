//! States of one service, from the parts in which they were handed out.

use vigil_blocks::{BlockId, CheckpointPart, STATE_BYTES_MAX};

/// A whole state.
pub(crate) struct WholeState {
    /// The journal's block after which it was so.
    pub(crate) after: BlockId,
    pub(crate) bytes: Vec<u8>,
}

/// Whole states that have not been used yet, the last few.
#[derive(Default)]
pub(crate) struct Checkpoints {
    whole: Vec<WholeState>,
    /// The one under way.
    partial: Option<WholeState>,
    /// Bytes of the last one that was too large to be handed out.
    too_large: Option<u32>,
}

/// States that wait to be used, at most.
const WHOLE_MAX: usize = 4;

impl Checkpoints {
    /// Takes the next part. Parts that do not follow each other make no state.
    pub(crate) fn take(&mut self, part: &CheckpointPart) {
        if part.whole as usize > STATE_BYTES_MAX {
            self.too_large = Some(part.whole);
            return;
        }
        let after = BlockId {
            epoch: part.journal_epoch,
            seq: part.journal_seq,
        };
        if part.offset == 0 {
            let bytes = Vec::new();
            self.partial = Some(WholeState { after, bytes });
        }
        let follows =
            |state: &WholeState| state.after == after && state.bytes.len() == part.offset as usize;
        let state = self.partial.take().filter(follows);
        let (Some(mut state), Some(bytes)) = (state, part.bytes.get(..part.size as usize)) else {
            return;
        };
        state.bytes.extend_from_slice(bytes);
        if state.bytes.len() < part.whole as usize {
            self.partial = Some(state);
            return;
        }
        if self.whole.len() == WHOLE_MAX {
            self.whole.remove(0);
        }
        self.whole.push(state);
    }

    /// Bytes of a state that was too large to be handed out, since the last call.
    pub(crate) const fn take_too_large(&mut self) -> Option<u32> {
        self.too_large.take()
    }

    /// The state after a block of the journal; it and older ones go.
    pub(crate) fn after(&mut self, id: BlockId) -> Option<WholeState> {
        let found = self.whole.iter().position(|state| state.after == id)?;
        self.whole.drain(..=found).next_back()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parts(bytes: &[u8], seq: u64) -> Vec<CheckpointPart> {
        let cut = bytes.chunks(3).enumerate().map(|(place, chunk)| {
            let mut part = CheckpointPart {
                journal_epoch: 7,
                journal_seq: seq,
                offset: 3 * place as u32,
                size: chunk.len() as u32,
                whole: bytes.len() as u32,
                ..CheckpointPart::default()
            };
            part.bytes[..chunk.len()].copy_from_slice(chunk);
            part
        });
        cut.collect()
    }

    fn id(seq: u64) -> BlockId {
        BlockId { epoch: 7, seq }
    }

    #[test]
    fn a_state_is_whole_with_its_last_part() {
        let mut states = Checkpoints::default();
        let parts = parts(b"12345678", 5);
        states.take(&parts[0]);
        states.take(&parts[1]);
        assert!(states.after(id(5)).is_none());
        states.take(&parts[2]);
        assert!(states.after(id(4)).is_none());
        assert_eq!(states.after(id(5)).unwrap().bytes, b"12345678");
        assert!(states.after(id(5)).is_none());
    }

    #[test]
    fn a_state_with_a_part_lost_or_of_another_size_is_none() {
        let mut states = Checkpoints::default();
        let mut broken = parts(b"12345678", 5);
        states.take(&broken[0]);
        states.take(&broken[2]);
        assert!(states.after(id(5)).is_none());
        broken[1].size = u32::MAX;
        broken.iter().for_each(|part| states.take(part));
        assert!(states.after(id(5)).is_none());
    }
}
