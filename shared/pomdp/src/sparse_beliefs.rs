//! Many sparse beliefs side by side, equal ones stored once.

use std::collections::HashMap;

use crate::fnv1a;

/// Entries that agree in the first 42 bits of their mantissas are the same belief, reached by
/// different sums: a relative difference of at most [`MERGED`].
const BITS_DROPPED: u32 = 10;
/// How much the entries of merged beliefs may differ, relatively.
pub(crate) const MERGED: f64 = 1.0 / (1_u64 << (52 - BITS_DROPPED)) as f64;

/// Index of a stored belief.
pub(crate) type BeliefId = u32;

/// The store; beliefs are lists of (state, probability > 0), ordered by state.
#[derive(Debug, Clone, Default)]
pub(crate) struct SparseBeliefs {
    ends: Vec<usize>,
    entries: Vec<(u32, f64)>,
    /// By hash, the last belief with it.
    last: HashMap<u64, BeliefId>,
    /// For each belief, the one before it with the same hash.
    before: Vec<Option<BeliefId>>,
}

impl SparseBeliefs {
    /// How many.
    pub(crate) fn len(&self) -> usize {
        self.ends.len()
    }

    /// Entries of all of them.
    pub(crate) fn entry_count(&self) -> usize {
        self.entries.len()
    }

    /// A belief's entries.
    pub(crate) fn entries(&self, id: BeliefId) -> &[(u32, f64)] {
        let id = id as usize;
        let first = if id == 0 { 0 } else { self.ends[id - 1] };
        &self.entries[first..self.ends[id]]
    }

    /// Stores a belief unless it is there; returns which it is.
    pub(crate) fn intern(&mut self, belief: &[(u32, f64)]) -> BeliefId {
        let hash = belief.iter().fold(fnv1a::BASIS, |hash, (state, p)| {
            mix(hash ^ key(*p) ^ (u64::from(*state) << 54))
        });
        let last = self.last.get(&hash).copied();
        let mut candidate = last;
        while let Some(id) = candidate {
            if is_same(self.entries(id), belief) {
                return id;
            }
            candidate = self.before[id as usize];
        }
        let id = self.ends.len() as BeliefId;
        self.entries.extend_from_slice(belief);
        self.ends.push(self.entries.len());
        self.before.push(last);
        self.last.insert(hash, id);
        id
    }
}

/// The entries of a dense belief.
pub(crate) fn sparse(belief: &[f64]) -> Vec<(u32, f64)> {
    let entries = belief.iter().enumerate().filter(|(_, b)| **b > 0.0);
    entries.map(|(s, b)| (s as u32, *b)).collect()
}

/// What the values of all states are worth at a belief.
pub(crate) fn dot(values: &[f64], belief: &[(u32, f64)]) -> f64 {
    belief.iter().map(|(s, b)| b * values[*s as usize]).sum()
}

const fn key(p: f64) -> u64 {
    (p.to_bits() + (1 << (BITS_DROPPED - 1))) >> BITS_DROPPED
}

/// The finaliser of MurmurHash3: every bit of the input reaches every bit of the output.
const fn mix(mut hash: u64) -> u64 {
    hash ^= hash >> 33;
    hash = hash.wrapping_mul(0xff51_afd7_ed55_8ccd);
    hash ^= hash >> 33;
    hash = hash.wrapping_mul(0xc4ce_b9fe_1a85_ec53);
    hash ^ (hash >> 33)
}

fn is_same(a: &[(u32, f64)], b: &[(u32, f64)]) -> bool {
    let mut pairs = a.iter().zip(b);
    a.len() == b.len() && pairs.all(|(a, b)| a.0 == b.0 && key(a.1) == key(b.1))
}

#[test]
fn equal_beliefs_are_stored_once_and_small_entries_count() {
    let mut store = SparseBeliefs::default();
    let first = store.intern(&[(0, 0.1 + 0.2), (3, 0.7)]);
    assert_eq!(store.intern(&[(0, 0.3), (3, 0.7)]), first);
    let other = store.intern(&[(0, 0.3), (2, 1e-12), (3, 0.7)]);
    assert_ne!(other, first);
    assert_ne!(store.intern(&[(0, 0.3), (2, 1.1e-12), (3, 0.7)]), other);
    assert_eq!((store.len(), store.entry_count()), (3, 8));
    assert_eq!(store.entries(other)[1], (2, 1e-12));
}
