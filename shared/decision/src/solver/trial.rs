//! Trials.

use super::tree::Tree;
use super::{Bracket, Options, Progress};
use crate::budget::{Budget, Stopped};
use crate::sparse_beliefs::BeliefId;

const DEPTH_MAX: usize = 2000;

pub(super) fn search(
    mut tree: Tree<'_>,
    options: &Options,
    budget: &mut Budget<'_>,
    watch: &mut dyn FnMut(&Progress),
) -> Result<Progress, Stopped> {
    let zeta: f64 = std::env::var("ZETA").ok().and_then(|z| z.parse().ok()).unwrap_or(0.5);
    let start: Vec<(u32, f64)> = tree
        .model
        .start()
        .iter()
        .enumerate()
        .filter(|(_, b)| **b > 0.0)
        .map(|(s, b)| (s as u32, *b))
        .collect();
    let root = tree.node(&start, budget)?;
    let mut progress = state(&mut tree, root, 0, 0, budget)?;
    while progress.bracket.gap() > options.precision && progress.bytes < options.memory_bytes_max {
        let target = options.precision.max(zeta * progress.bracket.gap());
        let depth = match trial(&mut tree, root, target, budget) {
            Ok(depth) => depth,
            Err(Stopped) => break,
        };
        match state(&mut tree, root, progress.trials + 1, depth, budget) {
            Ok(next) => progress = next,
            Err(Stopped) => break,
        }
        watch(&progress);
    }
    Ok(progress)
}

fn state(
    tree: &mut Tree<'_>,
    root: BeliefId,
    trials: usize,
    depth: usize,
    budget: &mut Budget<'_>,
) -> Result<Progress, Stopped> {
    let bracket = Bracket {
        lower: tree.lower(root, budget)?,
        upper: tree.upper(root, budget)?,
    };
    Ok(Progress {
        bracket,
        trials,
        alphas: tree.alphas.len(),
        alphas_active: tree.alphas.active_count(),
        points: tree.sawtooth.point_count(),
        beliefs: tree.beliefs.len(),
        bytes: tree.bytes(),
        depth,
    })
}

fn trial(
    tree: &mut Tree<'_>,
    root: BeliefId,
    target: f64,
    budget: &mut Budget<'_>,
) -> Result<usize, Stopped> {
    let mut path = vec![root];
    let mut node = root;
    let mut allowed = target;
    while path.len() < DEPTH_MAX {
        if tree.upper(node, budget)? - tree.lower(node, budget)? <= allowed {
            break;
        }
        let action = tree.lower_upper(node, budget)?;
        allowed /= tree.model.discount();
        let mut best = (0.0, None);
        for child in tree.children_of(node, action, budget)? {
            let child = tree.children[child];
            let gap = tree.upper(child.node, budget)? - tree.lower(child.node, budget)?;
            let excess = child.probability * (gap - allowed);
            if excess > best.0 {
                best = (excess, Some(child.node));
            }
        }
        let Some(next) = best.1 else { break };
        node = next;
        path.push(node);
    }
    for node in path.iter().rev() {
        tree.lower_upper(*node, budget)?;
        tree.raise_lower(*node, budget)?;
    }
    Ok(path.len())
}
