//! The tree of a search: nodes are beliefs, branches actions, in arenas of fixed size.

use super::generator::{Generator, largest};
use super::scenarios::Scenarios;

/// No index.
const NONE: u32 = u32::MAX;

/// Bounds of what a node adds to the value of the root: weighted by its probability and discounted.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(super) struct Worth {
    /// What is earned for certain in the scenarios, less the cost of the plan.
    pub lower: f64,
    pub upper: f64,
    /// In between: what is expected where the search has ended.
    pub estimate: f64,
}

impl Worth {
    const NOTHING: Self = Self {
        lower: 0.0,
        upper: 0.0,
        estimate: 0.0,
    };

    fn add(&mut self, other: Self) {
        self.lower += other.lower;
        self.upper += other.upper;
        self.estimate += other.estimate;
    }

    fn at_least(&mut self, other: Self) {
        self.lower = self.lower.max(other.lower);
        self.upper = self.upper.max(other.upper);
        self.estimate = self.estimate.max(other.estimate);
    }

    const fn gap(self) -> f64 {
        self.upper - self.lower
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
    /// Of the best plan that is known without a search.
    plain: f64,
    worth: Worth,
    /// The widest gap of a leaf that the best actions may lead to.
    widest: f64,
}

/// An action in a node.
#[derive(Debug, Clone, Copy)]
struct Branch {
    node: u32,
    first_child: u32,
    children: u32,
    /// Weighted, discounted, less the cost of a node.
    reward: f64,
    worth: Worth,
}

/// What limits and shapes a search.
#[derive(Debug, Clone, Copy)]
pub(super) struct Limits {
    pub nodes: usize,
    pub depth: usize,
    /// Cost of a node of a plan.
    pub cost: f64,
    /// Where between its bounds a node without branches is worth what.
    pub optimism: f64,
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
    /// Observations of which `sums` holds anything.
    met: Vec<u32>,
    is_met: Vec<bool>,
}

impl Tree {
    pub(super) fn new(generator: &Generator, scenarios: usize, limits: Limits) -> Self {
        Self {
            limits,
            nodes: Vec::with_capacity(limits.nodes.max(1)),
            branches: Vec::with_capacity(limits.nodes),
            states: Vec::with_capacity(limits.nodes * scenarios),
            weights: vec![0.0; scenarios],
            sums: vec![0.0; generator.observations * generator.width()],
            met: Vec::with_capacity(generator.observations),
            is_met: vec![false; generator.observations],
        }
    }

    /// Forgets everything.
    pub(super) fn clear(&mut self) {
        self.nodes.clear();
        self.branches.clear();
        self.states.clear();
    }

    /// A root for scenarios that have just been drawn.
    pub(super) fn plant(&mut self, generator: &Generator, scenarios: &Scenarios) {
        self.clear();
        let sums = &mut self.sums[..generator.width()];
        sums.fill(0.0);
        for (&state, weight) in scenarios.states().iter().zip(scenarios.weights()) {
            add_scaled(sums, generator.bounds(state), *weight);
        }
        let (upper, plans) = sums.split_at(generator.actions);
        let bounds = (largest(plans), largest(upper));
        let root = leaf(NONE, 0, 0, bounds, &self.limits);
        self.nodes.push(root);
    }

    /// Bounds of the root.
    pub(super) fn root(&self) -> Worth {
        self.nodes.first().map_or(Worth::NOTHING, |root| root.worth)
    }

    /// Bounds of an action in the root; `None` before the first trial.
    pub(super) fn action(&self, action: usize) -> Option<Worth> {
        let root = self.nodes.first()?;
        let branch = (root.first_branch as usize).checked_add(action)?;
        self.branches.get(branch).map(|branch| branch.worth)
    }

    /// Goes down to where the best action is most uncertain, and looks one step further there.
    /// False if there is nothing to gain, or no room.
    pub(super) fn grow(&mut self, generator: &Generator, scenarios: &mut Scenarios) -> bool {
        let room = generator.actions * generator.observations;
        if self.nodes.is_empty() || self.nodes.len() + room > self.limits.nodes {
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
        if self.nodes[at].worth.gap() <= 0.0 || !self.expand(at, generator, scenarios) {
            return false;
        }
        self.back_up(at, generator.actions);
        true
    }

    /// The most uncertain child of the best action of a node.
    fn most_uncertain(&self, at: usize, actions: usize) -> Option<usize> {
        let first = self.nodes[at].first_branch as usize;
        let branches = self.branches.get(first..first + actions)?.iter();
        let best = branches.reduce(|best, other| {
            let is_better = other.worth.upper > best.worth.upper;
            if is_better { other } else { best }
        })?;
        let children = best.first_child as usize..(best.first_child + best.children) as usize;
        let mut widest = (None, 0.0);
        for child in children {
            let gap = self.nodes[child].widest;
            if gap > widest.1 {
                widest = (Some(child), gap);
            }
        }
        widest.0
    }

    /// Takes the observation of a node into account.
    fn weigh(&mut self, at: usize, generator: &Generator) {
        let Node { branch, observation, .. } = self.nodes[at];
        let action = self.action_of(branch as usize);
        let count = self.weights.len();
        let states = &self.states[branch as usize * count..][..count];
        for (weight, &next) in self.weights.iter_mut().zip(states) {
            if *weight > 0.0 {
                *weight *= generator.likelihood(next, action, observation);
            }
        }
    }

    fn action_of(&self, branch: usize) -> usize {
        let node = self.branches[branch].node as usize;
        branch - self.nodes[node].first_branch as usize
    }

    /// Gives a node its branches. False at the greatest depth.
    fn expand(&mut self, at: usize, generator: &Generator, scenarios: &mut Scenarios) -> bool {
        let Node { branch, depth, .. } = self.nodes[at];
        let count = self.weights.len();
        if scenarios.chances(depth as usize).is_none() {
            return false;
        }
        self.nodes[at].first_branch = self.branches.len() as u32;
        for action in 0..generator.actions {
            let before = self.states.len();
            for scenario in 0..count {
                let state = match branch {
                    NONE => scenarios.states()[scenario],
                    branch => self.states[branch as usize * count + scenario],
                };
                let chance = scenarios.chances(depth as usize).map_or(0.0, |c| c[scenario]);
                self.states.push(generator.successor(state, action, chance));
            }
            let _ = before;
            self.branch(at, action, generator, scenarios);
        }
        true
    }

    /// One branch, whose scenarios' states have just been written.
    fn branch(
        &mut self,
        at: usize,
        action: usize,
        generator: &Generator,
        scenarios: &Scenarios,
    ) {
        let Node { branch, depth, .. } = self.nodes[at];
        let (count, width) = (self.weights.len(), generator.width());
        let first = self.states.len() - count;
        let mut reward = 0.0;
        for scenario in 0..count {
            let weight = self.weights[scenario];
            if weight <= 0.0 {
                continue;
            }
            let state = match branch {
                NONE => scenarios.states()[scenario],
                branch => self.states[branch as usize * count + scenario],
            };
            reward += weight * generator.reward(state, action);
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
        let discount = generator.discount.powi(depth as i32);
        let index = self.branches.len() as u32;
        let reward = discount * reward - self.limits.cost;
        let first_child = self.nodes.len() as u32;
        let mut worth = Worth { lower: reward, upper: reward, estimate: reward };
        for &z in &self.met {
            self.is_met[z as usize] = false;
            let sums = &self.sums[z as usize * width..][..width];
            let (upper, plans) = sums.split_at(generator.actions);
            let next = discount * generator.discount;
            let bounds = (next * largest(plans), next * largest(upper));
            let child = leaf(index, z, depth + 1, bounds, &self.limits);
            worth.add(child.worth);
            self.nodes.push(child);
        }
        self.met.clear();
        self.branches.push(Branch {
            node: at as u32,
            first_child,
            children: self.nodes.len() as u32 - first_child,
            reward,
            worth,
        });
    }

    /// From a node whose branches are new to the root.
    fn back_up(&mut self, mut at: usize, actions: usize) {
        loop {
            let node = self.nodes[at];
            let first = node.first_branch as usize;
            let mut worth = Worth { lower: node.plain, upper: node.plain, estimate: node.plain };
            for branch in &self.branches[first..first + actions] {
                worth.at_least(branch.worth);
            }
            self.nodes[at].worth = worth;
            let child = self.most_uncertain(at, actions);
            self.nodes[at].widest = child.map_or(0.0, |child| self.nodes[child].widest);
            if node.branch == NONE {
                return;
            }
            let branch = self.branches[node.branch as usize];
            let children = branch.first_child as usize..(branch.first_child + branch.children) as usize;
            let reward = branch.reward;
            let mut worth = Worth { lower: reward, upper: reward, estimate: reward };
            for child in &self.nodes[children] {
                worth.add(child.worth);
            }
            self.branches[node.branch as usize].worth = worth;
            at = branch.node as usize;
        }
    }
}

fn leaf(branch: u32, observation: u32, depth: u32, bounds: (f64, f64), limits: &Limits) -> Node {
    let (lower, upper) = bounds;
    let is_last = depth as usize >= limits.depth;
    let upper = if is_last { lower } else { lower.max(upper - limits.cost) };
    Node {
        branch,
        observation,
        first_branch: NONE,
        depth,
        plain: lower,
        worth: Worth {
            lower,
            upper,
            estimate: lower + limits.optimism * (upper - lower),
        },
        widest: upper - lower,
    }
}

fn add_scaled(sums: &mut [f64], values: &[f64], factor: f64) {
    for (sum, value) in sums.iter_mut().zip(values) {
        *sum += factor * value;
    }
}
