//! The beliefs that were reached, what may follow upon them, and what is known of their values.

use super::alphas::{AlphaId, Alphas};
use super::followers::Followers;
use super::sawtooth::{Query, Sawtooth};
use crate::bounds::tib::Tib;
use crate::budget::{Budget, StopRequest};
use crate::model::Pomdp;
use crate::sparse_beliefs::{BeliefId, SparseBeliefs};

/// What is known of a belief.
#[derive(Debug, Clone, Copy)]
pub(super) struct Node {
    pub lower: f64,
    /// The vector that gives `lower`.
    pub witness: AlphaId,
    pub alphas_seen: u32,
    pub upper: f64,
    pub points_seen: u32,
    /// Its first branch.
    pub branches: Option<u32>,
}

/// What is known of an action at a belief.
#[derive(Debug, Clone, Copy)]
pub(super) struct Branch {
    /// R(b,a).
    pub reward: f64,
    /// Upper bound of Q(b,a).
    pub upper: f64,
    /// First child and number of children, once expanded.
    pub children: Option<(u32, u32)>,
}

/// A belief that may follow.
#[derive(Debug, Clone, Copy)]
pub(super) struct Child {
    pub probability: f64,
    pub observation: u32,
    pub node: BeliefId,
}

/// The tree; equal beliefs share a node, so that it is a graph.
pub(super) struct Tree<'m> {
    pub model: &'m Pomdp,
    pub tib: Option<&'m Tib>,
    pub beliefs: SparseBeliefs,
    pub nodes: Vec<Node>,
    pub branches: Vec<Branch>,
    pub children: Vec<Child>,
    pub alphas: Alphas,
    pub sawtooth: Sawtooth,
    /// Backups of the lower bound try every action, not only the most promising ones.
    pub is_thorough: bool,
    /// What [`Self::bytes`] may be: beyond it nothing is expanded that could be left.
    pub bytes_max: usize,
    pub followers: Followers,
}

impl<'m> Tree<'m> {
    pub(super) fn new(
        model: &'m Pomdp,
        tib: Option<&'m Tib>,
        alphas: Alphas,
        sawtooth: Sawtooth,
    ) -> Self {
        Self {
            model,
            tib,
            beliefs: SparseBeliefs::default(),
            nodes: Vec::new(),
            branches: Vec::new(),
            children: Vec::new(),
            alphas,
            sawtooth,
            is_thorough: false,
            bytes_max: usize::MAX,
            followers: Followers::new(model),
        }
    }

    /// Bytes that the tree holds, about.
    pub(super) fn bytes(&self) -> usize {
        let alpha = 8 * self.model.states().len() + 4 * self.model.observations().len() + 16;
        16 * self.beliefs.entry_count()
            + (48 + size_of::<Node>()) * self.nodes.len()
            + size_of::<Branch>() * self.branches.len()
            + size_of::<Child>() * self.children.len()
            + alpha * self.alphas.len()
            + self.sawtooth.bytes()
    }

    /// The node of a belief; a new one is valued.
    pub(super) fn node(
        &mut self,
        entries: &[(u32, f64)],
        budget: &mut Budget<'_>,
    ) -> Result<BeliefId, StopRequest> {
        let id = self.beliefs.intern(entries);
        if (id as usize) < self.nodes.len() {
            return Ok(id);
        }
        let mut upper = self.sawtooth.base_value(entries);
        if let Some(tib) = self.tib {
            budget.spend(tib.work() * self.model.actions().len() * entries.len())?;
            upper = upper.min(tib.value_sparse(entries));
        }
        self.nodes.push(Node {
            lower: f64::NEG_INFINITY,
            witness: 0,
            alphas_seen: 0,
            upper,
            points_seen: 0,
            branches: None,
        });
        Ok(id)
    }

    /// The lower bound of a node under the newest vectors.
    pub(super) fn lower(
        &mut self,
        id: BeliefId,
        budget: &mut Budget<'_>,
    ) -> Result<f64, StopRequest> {
        let node = &mut self.nodes[id as usize];
        if node.alphas_seen < self.alphas.stamp() {
            let belief = self.beliefs.entries(id);
            let known = (node.witness, node.lower);
            let (best, looked_at) = self.alphas.best_since(node.alphas_seen, belief, known);
            (node.witness, node.lower) = best;
            node.alphas_seen = self.alphas.stamp();
            budget.spend(looked_at * belief.len())?;
        }
        Ok(node.lower)
    }

    /// The upper bound of a node under the newest points.
    pub(super) fn upper(
        &mut self,
        id: BeliefId,
        budget: &mut Budget<'_>,
    ) -> Result<f64, StopRequest> {
        let node = &mut self.nodes[id as usize];
        if node.points_seen < self.sawtooth.stamp() || node.points_seen == 0 {
            let query = Query {
                entries: self.beliefs.entries(id),
                value: node.upper,
                seen: node.points_seen,
            };
            let (upper, work) = self.sawtooth.value(&self.beliefs, &query);
            node.upper = upper;
            node.points_seen = self.sawtooth.stamp();
            budget.spend(work)?;
        }
        Ok(node.upper)
    }

    /// Upper less lower bound of a node.
    pub(super) fn gap(
        &mut self,
        id: BeliefId,
        budget: &mut Budget<'_>,
    ) -> Result<f64, StopRequest> {
        Ok(self.upper(id, budget)? - self.lower(id, budget)?)
    }

    /// The first branch of a node; made if it is not there yet.
    pub(super) fn branches_of(
        &mut self,
        id: BeliefId,
        budget: &mut Budget<'_>,
    ) -> Result<usize, StopRequest> {
        if let Some(first) = self.nodes[id as usize].branches {
            return Ok(first as usize);
        }
        let first = self.branches.len();
        let actions = self.model.actions().len();
        let belief = self.beliefs.entries(id);
        let cap = self.nodes[id as usize].upper;
        for a in 0..actions {
            let rewards = belief.iter();
            let reward = rewards.map(|(s, b)| b * self.model.reward(*s as usize, a));
            let upper = self.tib.map_or(cap, |tib| tib.q_sparse(belief, a).min(cap));
            self.branches.push(Branch {
                reward: reward.sum(),
                upper,
                children: None,
            });
        }
        let work = self.tib.map_or(1, Tib::work) * actions * belief.len();
        self.nodes[id as usize].branches = Some(first as u32);
        budget.spend(work)?;
        Ok(first)
    }

    /// The children of an action at a node; made if they are not there yet.
    pub(super) fn children_of(
        &mut self,
        id: BeliefId,
        action: usize,
        budget: &mut Budget<'_>,
    ) -> Result<std::ops::Range<usize>, StopRequest> {
        let branch = self.branches_of(id, budget)? + action;
        if let Some((first, count)) = self.branches[branch].children {
            return Ok(first as usize..(first + count) as usize);
        }
        let model = self.model;
        let mut followers = std::mem::take(&mut self.followers);
        let belief = self.beliefs.entries(id).to_vec();
        let mut made = Vec::new();
        let work = followers.each(model, &belief, action, |follower| {
            made.push(Child {
                probability: follower.probability,
                observation: follower.observation as u32,
                node: self.node(follower.belief, budget)?,
            });
            Ok(())
        });
        self.followers = followers;
        let work = work?;
        let first = self.children.len();
        self.children.extend(&made);
        self.branches[branch].children = Some((first as u32, made.len() as u32));
        budget.spend(work)?;
        Ok(first..first + made.len())
    }
}
