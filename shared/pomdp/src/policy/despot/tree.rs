//! The tree of a search, in arenas of fixed size: nodes are beliefs, branches actions.
//!
//! Values are weighted: by the probability of a node, by the discount of its depth, and less the
//! cost of every node of a plan (Ye et al. 2017, section 5). So bounds of children simply add up.

use super::generator::{Generator, largest};
use super::scenarios::{Sampler, Scenario};
use crate::weights::Weights;

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
    /// The scenarios after the action, before the observation.
    first_scenario: u32,
    scenarios: u32,
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
    /// Those of the root, then those of every branch.
    scenarios: Vec<Scenario>,
    /// Of the node that is looked at.
    present: Vec<Scenario>,
    /// The belief after an action, all 0 between calls.
    predicted: Weights,
    /// For each observation: the weighted sum of the bounds.
    sums: Vec<f64>,
    /// Observations of which `sums` holds something.
    met: Vec<u32>,
    is_met: Vec<bool>,
}

impl Tree {
    /// Without a root; `scenarios` of each belief at most.
    pub(super) fn new(generator: &Generator, scenarios: usize, limits: Limits) -> Self {
        Self {
            limits,
            nodes: Vec::with_capacity(limits.nodes),
            // Every branch has a child.
            branches: Vec::with_capacity(limits.nodes),
            scenarios: Vec::with_capacity((limits.nodes + 1) * scenarios),
            present: Vec::with_capacity(scenarios),
            predicted: Weights::new(generator.states),
            sums: vec![0.0; generator.observations * generator.width()],
            met: Vec::with_capacity(generator.observations),
            is_met: vec![false; generator.observations],
        }
    }

    /// Memory of a tree, bytes.
    pub(super) const fn bytes(nodes: usize, scenarios: usize) -> usize {
        let of_scenarios = size_of::<Scenario>().saturating_mul(scenarios);
        let of_node = size_of::<Node>() + size_of::<Branch>();
        nodes
            .saturating_add(1)
            .saturating_mul(of_scenarios.saturating_add(of_node))
    }

    /// Begins anew with a root of this belief.
    pub(super) fn plant(&mut self, generator: &Generator, sampler: &mut Sampler, belief: &[f64]) {
        self.nodes.clear();
        self.branches.clear();
        self.scenarios.clear();
        self.predicted.set(belief.iter().copied());
        sampler.begin(&self.predicted);
        sampler.draw(&self.predicted, &mut self.scenarios);
        self.predicted.clear();
        let sums = &mut self.sums[..generator.width()];
        sums.fill(0.0);
        for (state, weight) in &self.scenarios {
            add_scaled(sums, generator.bounds(*state), *weight);
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

    /// Scenarios of the root.
    pub(super) fn root_scenarios(&self) -> &[Scenario] {
        let end = self
            .branches
            .first()
            .map(|branch| branch.first_scenario as usize);
        &self.scenarios[..end.unwrap_or(self.scenarios.len())]
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
    pub(super) fn grow(&mut self, generator: &Generator, sampler: &mut Sampler) -> bool {
        let room = generator.actions * generator.observations;
        let is_full = self.nodes.len().saturating_add(room) > self.limits.nodes;
        if is_full || self.nodes.first().is_none_or(|root| root.widest <= 0.0) {
            return false;
        }
        let mut at = 0;
        while self.nodes[at].first_branch != NONE {
            let Some(child) = self.most_uncertain(at, generator.actions) else {
                return false;
            };
            at = child;
        }
        self.gather(at, generator);
        self.nodes[at].first_branch = self.branches.len() as u32;
        for action in 0..generator.actions {
            let reward = self.predict(action, generator);
            let first_scenario = self.scenarios.len();
            sampler.draw(&self.predicted, &mut self.scenarios);
            self.branches.push(Branch {
                node: at as u32,
                first_child: self.nodes.len() as u32,
                children: 0,
                first_scenario: first_scenario as u32,
                scenarios: (self.scenarios.len() - first_scenario) as u32,
                reward: generator.discount.powi(self.nodes[at].depth as i32) * reward
                    - self.limits.cost,
                bracket: Bracket::point(0.0),
            });
            self.observe(at, action, generator);
            self.predicted.clear();
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

    /// The scenarios of a node: those after the action that leads to it, weighed by the likelihood
    /// of the observation that does (Garg et al. 2019).
    fn gather(&mut self, at: usize, generator: &Generator) {
        let node = self.nodes[at];
        self.present.clear();
        if node.branch == NONE {
            let root = self.root_scenarios().len();
            return self.present.extend_from_slice(&self.scenarios[..root]);
        }
        let branch = self.branches[node.branch as usize];
        let parent = self.nodes[branch.node as usize];
        let action = (node.branch - parent.first_branch) as usize;
        let after = &self.scenarios[branch.first_scenario as usize..][..branch.scenarios as usize];
        let weighed = after.iter().map(|&(state, weight)| {
            let likelihood = generator.likelihood(state, action, node.observation);
            (state, weight * likelihood)
        });
        self.present
            .extend(weighed.filter(|(_, weight)| *weight > 0.0));
    }

    /// The belief after an action in the node that is looked at, and the expected reward.
    fn predict(&mut self, action: usize, generator: &Generator) -> f64 {
        let mut reward = 0.0;
        for &(state, weight) in &self.present {
            reward += weight * generator.reward(state, action);
            for &(next, p) in generator.successors(state, action) {
                self.predicted.add(next, weight * p);
            }
        }
        reward
    }

    /// Gives the newest branch a child for each observation, with bounds by all that is predicted.
    fn observe(&mut self, at: usize, action: usize, generator: &Generator) {
        let width = generator.width();
        for &next in self.predicted.support() {
            let weight = self.predicted.at(next);
            for &(z, p) in generator.observed(next, action) {
                let sums = &mut self.sums[z as usize * width..][..width];
                if !std::mem::replace(&mut self.is_met[z as usize], true) {
                    self.met.push(z);
                    sums.fill(0.0);
                }
                add_scaled(sums, generator.bounds(next), weight * p);
            }
        }
        let index = self.branches.len() - 1;
        for &observation in &self.met {
            self.is_met[observation as usize] = false;
            let child = Node {
                branch: index as u32,
                observation,
                first_branch: NONE,
                depth: self.nodes[at].depth + 1,
                ..self.nodes[at]
            };
            let sums = &self.sums[observation as usize * width..][..width];
            self.nodes.push(leaf(child, sums, generator, &self.limits));
        }
        let mut branch = self.branches[index];
        branch.children = self.met.len() as u32;
        self.met.clear();
        self.add_children(&mut branch);
        self.branches[index] = branch;
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
