//! A hash over what a model means.

use crate::fnv1a;

use super::Pomdp;

/// Hashes names and numbers: not layout, comments, or the way in which rules were written. Costs
/// are negative rewards, and count as such.
pub(super) fn hash(model: &Pomdp) -> u64 {
    let mut hash = fnv1a::hash_u64(fnv1a::BASIS, model.discount.to_bits());
    for names in [&model.states, &model.actions, &model.observations] {
        hash = fnv1a::hash_u64(hash, names.len() as u64);
        for name in names {
            hash = fnv1a::hash(fnv1a::hash(hash, name.as_bytes()), b"\0");
        }
    }
    for sparse in &model.transitions {
        for s in 0..model.states.len() {
            for (to, p) in sparse.row(s) {
                hash = fnv1a::hash_u64(fnv1a::hash_u64(hash, *to as u64), p.to_bits());
            }
            hash = fnv1a::hash_u64(hash, u64::MAX);
        }
    }
    for value in model.start.iter().chain(&model.observation) {
        hash = fnv1a::hash_u64(hash, value.to_bits());
    }
    let blocks: Vec<u64> = model.rewards.blocks().iter().map(block_hash).collect();
    for action in 0..model.actions.len() {
        for state in 0..model.states.len() {
            hash = fnv1a::hash_u64(hash, blocks[model.rewards.block_id(state, action)]);
        }
    }
    hash
}

fn block_hash(block: &super::rewards::Block) -> u64 {
    let first = fnv1a::hash_u64(fnv1a::BASIS, block.rest.to_bits());
    block.others.iter().fold(first, |hash, &(to, z, r)| {
        let hash = fnv1a::hash_u64(hash, u64::from(to) << 32 | u64::from(z));
        fnv1a::hash_u64(hash, r.to_bits())
    })
}
