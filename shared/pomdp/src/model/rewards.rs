//! R(s,a,s',z): one function of (s',z) for each (s,a), each different one stored once, and in it
//! only what differs from its most frequent value.

use std::collections::HashMap;

/// R(s,a,.,.) of one pair (s,a).
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Block {
    /// The most frequent value (of equally frequent ones the one with the smallest bits).
    pub rest: f64,
    /// (s', z, value) wherever the value is another, ascending.
    pub others: Vec<(u32, u32, f64)>,
}

/// Outcomes of a pair (s,a).
#[derive(Debug, Clone, Copy)]
pub(crate) struct BlockSize {
    /// Next states.
    pub next: usize,
    pub observations: usize,
}

impl Block {
    /// The canonical form of a block of this `size`: `rest`, but for `others`,
    /// which ascend.
    pub(crate) fn new(size: BlockSize, rest: f64, mut others: Vec<(u32, u32, f64)>) -> Self {
        let BlockSize { next, observations } = size;
        let mut counts: HashMap<u64, usize> = HashMap::new();
        counts.insert(rest.to_bits(), next * observations - others.len());
        for (_, _, value) in &others {
            *counts.entry(value.to_bits()).or_default() += 1;
        }
        let most = counts
            .iter()
            .map(|(bits, count)| (*count, std::cmp::Reverse(*bits)))
            .max();
        let bits = most.map_or(0, |(_, bits)| bits.0);
        if bits != rest.to_bits() {
            // Then `others` covers at least half of the block: to go through all is no more work.
            others = spread(next, observations, rest, &others);
        }
        others.retain(|(_, _, value)| value.to_bits() != bits);
        Self {
            rest: f64::from_bits(bits),
            others,
        }
    }

    /// R(s,a,s',z).
    pub(crate) fn at(&self, to: usize, z: usize) -> f64 {
        self.others
            .binary_search_by_key(&(to, z), |&(to, z, _)| (to as usize, z as usize))
            .map_or(self.rest, |found| self.others[found].2)
    }

    /// What differs from `rest` at s' = `to`.
    pub(crate) fn others_at(&self, to: usize) -> &[(u32, u32, f64)] {
        let first = self.others.partition_point(|o| (o.0 as usize) < to);
        let length = self.others[first..].partition_point(|o| o.0 as usize == to);
        &self.others[first..first + length]
    }
}

/// Every entry of a block.
fn spread(
    next: usize,
    observations: usize,
    rest: f64,
    others: &[(u32, u32, f64)],
) -> Vec<(u32, u32, f64)> {
    let mut others = others.iter().peekable();
    let mut all = Vec::with_capacity(next * observations);
    for to in 0..next as u32 {
        for z in 0..observations as u32 {
            let own = others.next_if(|o| (o.0, o.1) == (to, z));
            all.push(own.copied().unwrap_or((to, z, rest)));
        }
    }
    all
}

/// R of a whole model.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Rewards {
    states: usize,
    /// For (a, s) at a * states + s: which block.
    of: Vec<u32>,
    /// Different ones, in the order of their first use.
    blocks: Vec<Block>,
}

impl Rewards {
    /// Takes the blocks of all (a, s), states running faster; `of` indexes `blocks`.
    pub(crate) fn new(states: usize, of: &[u32], blocks: Vec<Block>) -> Self {
        let mut known: HashMap<Vec<u64>, u32> = HashMap::new();
        let mut kept = Vec::new();
        let mut renamed: Vec<Option<u32>> = vec![None; blocks.len()];
        let mut blocks: Vec<Option<Block>> = blocks.into_iter().map(Some).collect();
        let of = of.iter().map(|&block| {
            let slot = &mut renamed[block as usize];
            if let (None, Some(block)) = (*slot, blocks[block as usize].take()) {
                let id = *known.entry(key(&block)).or_insert_with(|| {
                    kept.push(block);
                    kept.len() as u32 - 1
                });
                *slot = Some(id);
            }
            slot.unwrap_or(0)
        });
        Self {
            states,
            of: of.collect(),
            blocks: kept,
        }
    }

    /// R(s,a,.,.).
    pub(crate) fn block(&self, state: usize, action: usize) -> &Block {
        &self.blocks[self.block_id(state, action)]
    }

    /// Which of [`Self::blocks`] is R(s,a,.,.).
    pub(crate) fn block_id(&self, state: usize, action: usize) -> usize {
        self.of[action * self.states + state] as usize
    }

    /// The different blocks.
    pub(crate) fn blocks(&self) -> &[Block] {
        &self.blocks
    }
}

fn key(block: &Block) -> Vec<u64> {
    let others = block.others.iter();
    let words = others.flat_map(|&(to, z, r)| [u64::from(to) << 32 | u64::from(z), r.to_bits()]);
    std::iter::once(block.rest.to_bits()).chain(words).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    const fn size(side: usize) -> BlockSize {
        BlockSize {
            next: side,
            observations: side,
        }
    }

    #[test]
    fn a_block_is_the_same_however_it_was_written() {
        let dense = vec![(0, 0, 1.0), (0, 1, 2.0), (1, 0, 2.0), (1, 1, 2.0)];
        let block = Block::new(size(2), 0.0, dense);
        assert_eq!(block, Block::new(size(2), 2.0, vec![(0, 0, 1.0)]));
        assert_eq!(block.others, [(0, 0, 1.0)]);
        assert_eq!((block.at(0, 0), block.at(1, 0)), (1.0, 2.0));
        // The default is not the most frequent value, and not the only one left.
        let block = Block::new(size(2), 5.0, vec![(0, 1, 7.0), (1, 0, 7.0), (1, 1, 7.0)]);
        assert_eq!((block.rest, block.at(0, 0)), (7.0, 5.0));
        assert_eq!(block.others_at(0), [(0, 0, 5.0)]);
        assert_eq!(block.others_at(1), []);
    }

    #[test]
    fn equal_blocks_are_stored_once() {
        let block = |r| Block::new(size(1), r, Vec::new());
        let rewards = Rewards::new(2, &[2, 0, 1, 2], vec![block(1.0), block(3.0), block(3.0)]);
        assert_eq!(rewards.blocks().len(), 2);
        let got = [(0, 0), (1, 0), (0, 1), (1, 1)].map(|(s, a)| rewards.block(s, a).rest);
        assert_eq!(got, [3.0, 1.0, 3.0, 3.0]);
    }
}
