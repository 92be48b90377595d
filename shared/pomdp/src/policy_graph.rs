//! The controller that a policy is from the start belief on: a graph of actions, connected by
//! observations.
//!
//! Beliefs that are reached are nodes, the most probable ones first; a belief that lies near one
//! that has a node, and leads to the same action, shares it. There are finitely many nodes: beyond
//! them, an edge leads to the nearest node with the same action (to the nearest, if none has it)
//! and says so ([`Edge::is_folded`]).

use crate::belief::{Evidence, Tracker};
use crate::model::Pomdp;
use crate::policy::Decider;

/// How far a graph goes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Limits {
    /// Nodes at most, 1 or more.
    pub nodes_max: usize,
    /// Beliefs share a node if the sum of their differences is at most this, 0 to 2.
    pub tolerance: f64,
}

/// A belief and what is done at it.
#[derive(Debug, Clone, PartialEq)]
pub struct Node {
    /// Index of the action.
    pub action: usize,
    /// The belief for which the node was made, one probability a state.
    pub belief: Vec<f64>,
    /// Discounted probability of the most probable way to it: gamma^t times that of the
    /// observations on the way.
    pub weight: f64,
}

/// Observations after which another node is next.
#[derive(Debug, Clone, PartialEq)]
pub struct Edge {
    /// Index of the node that is left.
    pub from: usize,
    /// Index of the node that is reached.
    pub to: usize,
    /// Observations and their probabilities p(z|a,b), the most probable first.
    pub observations: Vec<(usize, f64)>,
    /// True if the belief has no node, and this is the nearest.
    pub is_folded: bool,
}

impl Edge {
    /// Probability of all its observations.
    #[must_use]
    pub fn probability(&self) -> f64 {
        self.observations.iter().map(|(_, p)| p).sum()
    }
}

/// The graph; node 0 is the start.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct PolicyGraph {
    /// In the order in which they were made.
    pub nodes: Vec<Node>,
    /// One for each pair of nodes, and kind, at most.
    pub edges: Vec<Edge>,
}

/// A belief that waits for its node.
struct OpenBelief {
    from: usize,
    observation: usize,
    probability: f64,
    weight: f64,
    belief: Vec<f64>,
}

impl PolicyGraph {
    /// Follows `decider` from the start belief of `model`. A decider that remembers is asked as at
    /// the beginning of a mission.
    #[must_use]
    pub fn new(model: &Pomdp, decider: &mut Decider, limits: Limits) -> Self {
        let mut graph = Self::default();
        let mut tracker = Tracker::new(model);
        let start = tracker.belief().to_vec();
        let mut waiting = graph.open(model, decider, &mut tracker, start, 1.0);
        while let Some(next) = most_probable(&waiting) {
            let reached = waiting.swap_remove(next);
            decider.reset();
            let action = decider.decide(&reached.belief).action;
            let near = graph.nearest(&reached.belief, action);
            let room = graph.nodes.len() < limits.nodes_max;
            let (to, is_folded) = match near {
                Some((to, distance)) if distance <= limits.tolerance => (to, false),
                _ if room => {
                    let (belief, weight) = (reached.belief, reached.weight);
                    waiting.extend(graph.open(model, decider, &mut tracker, belief, weight));
                    (graph.nodes.len() - 1, false)
                }
                Some((to, _)) => (to, true),
                None => (graph.nearest_of_all(&reached.belief), true),
            };
            let observation = (reached.observation, reached.probability);
            graph.connect(reached.from, to, observation, is_folded);
        }
        for edge in &mut graph.edges {
            edge.observations.sort_by(|a, b| b.1.total_cmp(&a.1));
        }
        graph
    }

    /// Makes a node; returns what is reached from it.
    fn open(
        &mut self,
        model: &Pomdp,
        decider: &mut Decider,
        tracker: &mut Tracker,
        belief: Vec<f64>,
        weight: f64,
    ) -> Vec<OpenBelief> {
        decider.reset();
        let action = decider.decide(&belief).action;
        let from = self.nodes.len();
        let mut reached = Vec::new();
        for observation in 0..model.observations().len() {
            tracker.anchor(&belief);
            if let Evidence::Taken(probability) = tracker.update(model, action, observation) {
                reached.push(OpenBelief {
                    from,
                    observation,
                    probability,
                    weight: weight * probability * model.discount(),
                    belief: tracker.belief().to_vec(),
                });
            }
        }
        self.nodes.push(Node {
            action,
            belief,
            weight,
        });
        reached
    }

    /// The nearest node with this action, and the sum of differences to it.
    fn nearest(&self, belief: &[f64], action: usize) -> Option<(usize, f64)> {
        let nodes = self.nodes.iter().enumerate();
        let same = nodes.filter(|(_, node)| node.action == action);
        let distances = same.map(|(index, node)| (index, distance(&node.belief, belief)));
        distances.min_by(|a, b| a.1.total_cmp(&b.1))
    }

    fn nearest_of_all(&self, belief: &[f64]) -> usize {
        let distances = self.nodes.iter().map(|node| distance(&node.belief, belief));
        let nearest = distances.enumerate().min_by(|a, b| a.1.total_cmp(&b.1));
        nearest.map_or(0, |(index, _)| index)
    }

    fn connect(&mut self, from: usize, to: usize, observation: (usize, f64), is_folded: bool) {
        let same = |e: &&mut Edge| (e.from, e.to, e.is_folded) == (from, to, is_folded);
        match self.edges.iter_mut().find(same) {
            Some(edge) => edge.observations.push(observation),
            None => self.edges.push(Edge {
                from,
                to,
                observations: vec![observation],
                is_folded,
            }),
        }
    }

    /// Probability that the next observation leads along a folded edge, at the node where it is
    /// largest.
    #[must_use]
    pub fn folded_max(&self) -> f64 {
        let at = |node: usize| {
            let own = self.edges.iter().filter(|e| e.is_folded && e.from == node);
            own.map(Edge::probability).sum::<f64>()
        };
        (0..self.nodes.len()).map(at).fold(0.0, f64::max)
    }
}

fn distance(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| (a - b).abs()).sum()
}

/// Of equally probable ones the first that was reached.
fn most_probable(waiting: &[OpenBelief]) -> Option<usize> {
    let better = |a: usize, b: usize| {
        let key = |i: usize| (waiting[i].from, waiting[i].observation);
        let order = waiting[b].weight.total_cmp(&waiting[a].weight);
        if order.then(key(a).cmp(&key(b))).is_le() {
            a
        } else {
            b
        }
    };
    (0..waiting.len()).reduce(better)
}
