//! The tree of a search, in arenas of fixed size: nodes are beliefs, branches actions.
//!
//! Values are weighted: by the probability of a node, by the discount of its depth, and less the
//! cost of every node of a plan (Ye et al. 2017, section 5). So bounds of children simply add up.

use super::generator::{Generator, largest};
use super::scenarios::Scenarios;

/// No index.
const NONE: u32 = u32::MAX;

/// Bounds of what a node or a branch adds to the value of the root.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Bracket {
    pub lower: f64,
    pub upper: f64,
}

impl Bracket {
    const fn point(value: f64) -> Self {
        Self {
            lower: value,
            upper: value,
        }
    }

    fn add(&mut self, other: Self) {
        self.lower += other.lower;
        self.upper += other.upper;
    }

    fn raise(&mut self, other: Self) {
        self.lower = self.lower.max(other.lower);
        self.upper = self.upper.max(other.upper);
    }
}

/// The belief after some actions and observations.
#[derive(Debug, Clone, Copy)]
struct Node {
    /// The branch that leads here.
    branch: u32,
    /// The observation that leads here.
    observation: u32,
    /// The first of its branches, one an action; or none.
    first_branch: u32,
    depth: u32,
    /// What the best plan earns that is known without a search.
    plain: f64,
    bracket: Bracket,
    /// The widest gap of a leaf that the most promising actions may lead to.
    widest: f64,
}

/// An action in a node.
#[derive(Debug, Clone, Copy)]
struct Branch {
    node: u32,
    first_child: u32,
    children: u32,
    /// Less the cost of a node.
    reward: f64,
    bracket: Bracket,
}

/// What limits a search.
#[derive(Debug, Clone, Copy)]
pub(super) struct Limits {
    pub nodes: usize,
    pub depth: usize,
    /// Cost of a node of a plan.
    pub cost: f64,
}

/// The tree, and what its growth needs.
#[derive(Debug, Clone)]
pub(super) struct Tree {
    limits: Limits,
    nodes: Vec<Node>,
    branches: Vec<Branch>,
    /// The states of all scenarios after each branch.
    states: Vec<u32>,
    /// Of each scenario, in the node that is looked at.
    weights: Vec<f64>,
    /// For each observation: the weighted sum of the bounds.
    sums: Vec<f64>,
    /// Observations of which `sums` holds something.
    met: Vec<u32>,
    is_met: Vec<bool>,
}

impl Tree {
    /// Without a root.
    pub(super) fn new(generator: &Generator, scenarios: usize, limits: Limits) -> Self {
        Self {
            limits,
            nodes: Vec::with_capacity(limits.nodes),
            // Every branch has a child.
            branches: Vec::with_capacity(limits.nodes),
            states: Vec::with_capacity(limits.nodes * scenarios),
            weights: vec![0.0; scenarios],
            sums: vec![0.0; generator.observations * generator.width()],
            met: Vec::with_capacity(generator.observations),
            is_met: vec![false; generator.observations],
        }
    }

    /// Memory of a tree, bytes.
    pub(super) const fn bytes(nodes: usize, scenarios: usize) -> usize {
        let of_states = size_of::<u32>().saturating_mul(scenarios);
        nodes.saturating_mul(size_of::<Node>() + size_of::<Branch>() + of_states)
    }

    /// Begins anew with a root for scenarios that have just been drawn.
    pub(super) fn plant(&mut self, generator: &Generator, scenarios: &Scenarios) {
        self.nodes.clear();
        self.branches.clear();
        self.states.clear();
        let sums = &mut self.sums[..generator.width()];
        sums.fill(0.0);
        for (&state, weight) in scenarios.states().iter().zip(scenarios.weights()) {
            add_scaled(sums, generator.bounds(state), *weight);
        }
        let root = Node {
            branch: NONE,
            observation: 0,
            first_branch: NONE,
            depth: 0,
            plain: 0.0,
            bracket: Bracket::point(0.0),
            widest: 0.0,
        };
        self.nodes.push(leaf(root, sums, generator, &self.limits));
    }

    /// Bounds of the root.
    pub(super) fn root(&self) -> Option<Bracket> {
        self.nodes.first().map(|root| root.bracket)
    }

    /// Bounds of an action in the root; `None` before the first trial.
    pub(super) fn action(&self, action: usize) -> Option<Bracket> {
        let root = self.nodes.first()?;
        let branch = (root.first_branch as usize).checked_add(action)?;
        self.branches.get(branch).map(|branch| branch.bracket)
    }

    /// A trial: looks one step further at the leaf with the widest gap of all that the most
    /// promising actions may lead to (Ross et al. 2008, section 3.4). False if no such leaf is
    /// left, or no room.
    pub(super) fn grow(&mut self, generator: &Generator, scenarios: &mut Scenarios) -> bool {
        let room = generator.actions * generator.observations;
        let is_full = self.nodes.len().saturating_add(room) > self.limits.nodes;
        if is_full || self.nodes.first().is_none_or(|root| root.widest <= 0.0) {
            return false;
        }
        self.weights.copy_from_slice(scenarios.weights());
        let mut at = 0;
        while self.nodes[at].first_branch != NONE {
            let Some(child) = self.most_uncertain(at, generator.actions) else {
                return false;
            };
            at = child;
            self.weigh(at, generator);
        }
        if !scenarios.prepare(self.nodes[at].depth as usize) {
            return false;
        }
        self.nodes[at].first_branch = self.branches.len() as u32;
        for action in 0..generator.actions {
            self.simulate(at, action, generator, scenarios);
            self.observe(at, action, generator, scenarios);
        }
        self.back_up(at, generator.actions);
        true
    }

    /// The child of the most promising action that leads to the widest gap.
    fn most_uncertain(&self, at: usize, actions: usize) -> Option<usize> {
        let first = self.nodes[at].first_branch as usize;
        let branches = self.branches[first..first + actions].iter();
        let best = branches.reduce(|best, other| {
            let is_better = other.bracket.upper > best.bracket.upper;
            if is_better { other } else { best }
        })?;
        let widest = best.children().reduce(|widest, other| {
            let is_wider = self.nodes[other].widest > self.nodes[widest].widest;
            if is_wider { other } else { widest }
        });
        widest.filter(|child| self.nodes[*child].widest > 0.0)
    }

    /// The weights of a node, from those of its parent.
    fn weigh(&mut self, at: usize, generator: &Generator) {
        let Node {
            branch,
            observation,
            ..
        } = self.nodes[at];
        let parent = self.branches[branch as usize].node as usize;
        let action = branch as usize - self.nodes[parent].first_branch as usize;
        let count = self.weights.len();
        let states = &self.states[branch as usize * count..][..count];
        for (weight, &next) in self.weights.iter_mut().zip(states) {
            if *weight > 0.0 {
                *weight *= generator.likelihood(next, action, observation);
            }
        }
    }

    /// The state of a scenario in a node.
    fn state(&self, at: usize, scenario: usize, scenarios: &Scenarios) -> u32 {
        match self.nodes[at].branch {
            NONE => scenarios.states()[scenario],
            branch => self.states[branch as usize * self.weights.len() + scenario],
        }
    }

    /// Writes the states of the scenarios after one action more.
    fn simulate(&mut self, at: usize, action: usize, generator: &Generator, with: &Scenarios) {
        let depth = self.nodes[at].depth as usize;
        for (scenario, &chance) in with.chances(depth).iter().enumerate() {
            let state = self.state(at, scenario, with);
            self.states.push(generator.successor(state, action, chance));
        }
    }

    /// Adds the branch whose states have just been written, with a child for each observation.
    /// Every scenario counts in each of them, by the observation's likelihood (Garg et al. 2019).
    fn observe(&mut self, at: usize, action: usize, generator: &Generator, with: &Scenarios) {
        let (count, width) = (self.weights.len(), generator.width());
        let first = self.states.len() - count;
        let mut reward = 0.0;
        for scenario in 0..count {
            let weight = self.weights[scenario];
            if weight <= 0.0 {
                continue;
            }
            reward += weight * generator.reward(self.state(at, scenario, with), action);
            let next = self.states[first + scenario];
            for &(z, p) in generator.observed(next, action) {
                let sums = &mut self.sums[z as usize * width..][..width];
                if !std::mem::replace(&mut self.is_met[z as usize], true) {
                    self.met.push(z);
                    sums.fill(0.0);
                }
                add_scaled(sums, generator.bounds(next), weight * p);
            }
        }
        let depth = self.nodes[at].depth;
        let reward = generator.discount.powi(depth as i32) * reward - self.limits.cost;
        let (branch, first_child) = (self.branches.len() as u32, self.nodes.len() as u32);
        for &observation in &self.met {
            self.is_met[observation as usize] = false;
            let child = Node {
                branch,
                observation,
                first_branch: NONE,
                depth: depth + 1,
                ..self.nodes[at]
            };
            let sums = &self.sums[observation as usize * width..][..width];
            self.nodes.push(leaf(child, sums, generator, &self.limits));
        }
        self.met.clear();
        let mut branch = Branch {
            node: at as u32,
            first_child,
            children: self.nodes.len() as u32 - first_child,
            reward,
            bracket: Bracket::point(reward),
        };
        self.add_children(&mut branch);
        self.branches.push(branch);
    }

    fn add_children(&self, branch: &mut Branch) {
        branch.bracket = Bracket::point(branch.reward);
        for child in branch.children() {
            branch.bracket.add(self.nodes[child].bracket);
        }
    }

    /// Bounds from a node whose branches are new up to the root.
    fn back_up(&mut self, mut at: usize, actions: usize) {
        loop {
            let node = self.nodes[at];
            let first = node.first_branch as usize;
            let mut bracket = Bracket::point(node.plain);
            for branch in &self.branches[first..first + actions] {
                bracket.raise(branch.bracket);
            }
            let child = self.most_uncertain(at, actions);
            let widest = child.map_or(0.0, |child| self.nodes[child].widest);
            (self.nodes[at].bracket, self.nodes[at].widest) = (bracket, widest);
            if node.branch == NONE {
                return;
            }
            let mut branch = self.branches[node.branch as usize];
            self.add_children(&mut branch);
            self.branches[node.branch as usize] = branch;
            at = branch.node as usize;
        }
    }
}

impl Branch {
    const fn children(&self) -> std::ops::Range<usize> {
        self.first_child as usize..(self.first_child + self.children) as usize
    }
}

/// The node with bounds from the weighted sums of those of its states. At the greatest depth the
/// best plan that is known is followed.
fn leaf(node: Node, sums: &[f64], generator: &Generator, limits: &Limits) -> Node {
    let (upper, plans) = sums.split_at(generator.actions);
    let discount = generator.discount.powi(node.depth as i32);
    let plain = discount * largest(plans);
    let upper = match (node.depth as usize) < limits.depth {
        true => plain.max(discount * largest(upper) - limits.cost),
        false => plain,
    };
    Node {
        plain,
        bracket: Bracket {
            lower: plain,
            upper,
        },
        widest: upper - plain,
        ..node
    }
}

fn add_scaled(sums: &mut [f64], values: &[f64], factor: f64) {
    for (sum, value) in sums.iter_mut().zip(values) {
        *sum += factor * value;
    }
}
