//! The rules of R: blocks that many pairs (s,a) share are written once, others for each.

use super::{Number, put};
use crate::model::Pomdp;
use crate::model::rewards::Block;

/// Writes R; costs as costs.
pub(super) fn write(model: &Pomdp, text: &mut String) {
    let rewards = model.rewards();
    let (n, actions) = (model.states().len(), model.actions().len());
    let id = |state, action| rewards.block_id(state, action);
    let block = |state, action| rewards.block(state, action);
    let is_one = |action| (1..n).all(|state| id(state, action) == id(0, action));
    if (0..actions).all(|a| is_one(a) && id(0, a) == id(0, 0)) {
        write_block(model, text, ("*", "*"), block(0, 0));
        return;
    }
    let is_shared = |state| (1..actions).all(|action| id(state, action) == id(state, 0));
    let (shared, own): (Vec<usize>, Vec<usize>) = (0..n).partition(|&state| is_shared(state));
    for state in shared {
        write_block(model, text, ("*", &model.states()[state]), block(state, 0));
    }
    for (a, action) in model.actions().iter().enumerate() {
        if own.len() == n && is_one(a) {
            write_block(model, text, (action, "*"), block(0, a));
            continue;
        }
        for &state in &own {
            write_block(
                model,
                text,
                (action, &model.states()[state]),
                block(state, a),
            );
        }
    }
}

fn write_block(model: &Pomdp, text: &mut String, (action, state): (&str, &str), block: &Block) {
    let sign = if model.is_cost() { -1.0 } else { 1.0 };
    let (n, k) = (model.states().len(), model.observations().len());
    let is_mdp = model.is_mdp();
    let mut rule = |to: &str, z: &str, value: f64| {
        // Never a negative zero.
        let value = Number(sign * value + 0.0);
        if is_mdp {
            put(text, format_args!("R: {action} : {state} : {to} {value}"));
        } else {
            put(
                text,
                format_args!("R: {action} : {state} : {to} : {z} {value}"),
            );
        }
    };
    // What no rule names is 0. The rest comes first, as later rules win.
    if block.rest != 0.0 {
        rule("*", "*", block.rest);
    }
    let columns = whole_columns(block, n, k);
    for (z, value) in columns.iter().enumerate() {
        if let Some(value) = value {
            rule("*", &model.observations()[z], *value);
        }
    }
    for row in block.others.chunk_by(|one, other| one.0 == other.0) {
        let Some(&(to, _, first)) = row.first() else {
            continue;
        };
        let to = &model.states()[to as usize];
        if row.len() == k && row.iter().all(|o| o.2.to_bits() == first.to_bits()) {
            rule(to, "*", first);
            continue;
        }
        for &(_, z, value) in row {
            if columns[z as usize].is_none() {
                rule(to, &model.observations()[z as usize], value);
            }
        }
    }
}

/// For each z the value that it has at every s', if there is one other than the rest.
fn whole_columns(block: &Block, next: usize, observations: usize) -> Vec<Option<f64>> {
    let mut columns = vec![(0, None); observations];
    for &(_, z, value) in &block.others {
        let (count, first) = &mut columns[z as usize];
        let first = *first.get_or_insert(value);
        *count += usize::from(first.to_bits() == value.to_bits());
    }
    let whole = columns.into_iter();
    whole
        .map(|(count, value)| value.filter(|_| count == next && next > 1))
        .collect()
}
