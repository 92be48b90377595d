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
    let mut due = Due { controller: Rhythm { at: 0, pause: 8 }, grid: Rhythm { at: 0, pause: 8 }, active: 0, points: 0 };
    let mut is_stuck = false;
    while progress.bracket.gap() > options.precision && progress.bytes < options.memory_bytes_max {
        tree.is_thorough = is_stuck;
        let before = (tree.children.len(), progress.bracket.gap());
        let target = options.precision.max(zeta * progress.bracket.gap());
        let walked = if is_stuck {
            tree.advance_frontier(root, budget)
        } else {
            trial(&mut tree, root, target, budget)
        };
        let Ok(depth) = walked else { break };
        if sweep(&mut tree, root, &mut due, budget).is_err() {
            break;
        }
        match state(&mut tree, root, progress.trials + 1, depth, budget) {
            Ok(next) => progress = next,
            Err(Stopped) => break,
        }
        is_stuck =
            tree.children.len() == before.0 && progress.bracket.gap() > (1.0 - 1e-4) * before.1;
        watch(&progress);
    }
    Ok(progress)
}

/// When what is done now and then is next due.
struct Due {
    controller: Rhythm,
    grid: Rhythm,
    active: usize,
    points: usize,
}

/// Work that pays is done more often.
struct Rhythm {
    at: u64,
    pause: u64,
}

impl Rhythm {
    fn done(&mut self, before: u64, after: u64, pays: bool) {
        self.pause = if pays { (self.pause / 2).max(4) } else { (self.pause * 2).min(1024) };
        self.at = after + self.pause * (after - before);
    }
}

fn sweep(
    tree: &mut Tree<'_>,
    root: BeliefId,
    due: &mut Due,
    budget: &mut Budget<'_>,
) -> Result<(), Stopped> {
    let lower = tree.lower(root, budget)?;
    let upper = tree.upper(root, budget)?;
    let pays = 0.01 * (upper - lower);
    if budget.spent() >= due.controller.at {
        let before = budget.spent();
        let mut value = lower;
        for _ in 0..10 {
            tree.value_controller(root, budget)?;
            let next = tree.lower(root, budget)?;
            let is_enough = next - value <= pays;
            value = next;
            if is_enough { break; }
        }
        let gain = value - lower;
        if std::env::var("DBG").is_ok() { eprintln!("controller gain {gain} lower {lower} cost {}", budget.spent() - before); }
        due.controller.done(before, budget.spent(), gain > pays);
    }
    if budget.spent() >= due.grid.at {
        let before = budget.spent();
        tree.lower_all(budget)?;
        let gain = upper - tree.upper(root, budget)?;
        due.grid.done(before, budget.spent(), gain > pays);
    }
    if tree.alphas.active_count() > due.active.max(32) {
        tree.prune_alphas(budget)?;
        due.active = tree.alphas.active_count() * 3 / 2;
    }
    if tree.sawtooth.point_count() > due.points.max(200) {
        tree.prune_points(budget)?;
        due.points = tree.sawtooth.point_count() * 3 / 2;
    }
    Ok(())
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
