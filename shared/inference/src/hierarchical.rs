//! Hierarchical identification: faults are tracked together until data distinguishes them.
//!
//! The paper's identification filter (Verma, Fernandez and Simmons 2002, section 4.3) moves
//! particles down a tree: from nominal to an abstract node (a stuck wheel on the left), from there
//! to a leaf (the left front wheel). A classical filter commits each of its few fault particles to
//! one leaf at once; an abstract particle stands for all leaves below it.
//!
//! Here an abstract particle carries the probability of each leaf below it, given its own path:
//! with predicted shares `s_k`, a state drawn from the mixture `Σ s_k p(c' | k, c)` and the
//! observation, `s_k' ∝ s_k p(c' | k, c) p(z | k, c')`, and the particle's weight is multiplied by
//! `Σ s_k p(c'|k,c) p(z|k,c') / Σ s_k p(c'|k,c)`. So nothing is lost when it moves down.
//!
//! **When a node is split.** The rule of the variable resolution filter (Verma, Thrun and Simmons,
//! IJCAI 2003) weighs the bias of a coarse answer, which divides the node's mass `p_A` by prior
//! shares, against the variance `p_k (1 - p_k) / N` of the fine one. Here particles carry shares,
//! so that the coarse answer has no such bias. Splitting only adds variance:
//! `p_A Σ s_k (1 - s_k) / N`, with the shares `s_k` directly below the node. Out of that noise the
//! other leaves have to grow if later data favours them. A split node saves time: one likelihood
//! per particle instead of one per leaf. So a node is split when the added variance is negligible
//! (a share above 0.999), and merged again when its leaves blur (below 0.99). In a tree of several
//! levels particles move down one level at a time.

use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;
use vigil_checkpoint::{Checkpoint, CheckpointValue};

use crate::filter::{Event, Filter, SUM_TOLERANCE, Step};
use crate::hybrid::{self, Sampled};
use crate::resample::{Resampling, systematic};
use crate::weights::Weights;

mod nodes;

pub use nodes::HierarchyError;
use nodes::{Node, arrange};

/// Share below a node above which it is split, and share below which it is merged. Chosen by hand:
/// the remainders differ by a factor of ten, so that a node does not toggle; the rule is within the
/// noise of the better fixed resolution (`tests/filters/hierarchy.rs`).
const SPLIT: f64 = 0.999;
const MERGE: f64 = 0.99;
/// A node with the mass of fewer particles than this is merged: too few to distinguish leaves.
/// Chosen by hand; more merges nodes of rare faults, less splits by chance.
const PARTICLES_MIN: f64 = 3.0;

/// The hierarchical filter over the modes and states of `M`.
#[derive(Debug, Clone, Checkpoint)]
#[checkpoint(bound = "M: Checkpoint")]
#[checkpoint(bound = "M::State: CheckpointValue")]
pub struct Hierarchical<M: Sampled> {
    model: M,
    #[checkpoint(each)]
    nodes: Vec<Node>,
    /// Abstract nodes above each mode, from the top.
    above: Vec<Vec<usize>>,
    #[checkpoint(fixed)]
    resampling: Resampling,
    rng: Pcg64Mcg,
    count_max: usize,
    /// Particles wanted at present, at most `count_max`.
    allowed: usize,
    states: Vec<M::State>,
    other_states: Vec<M::State>,
    /// Row i: the share of each mode in particle i.
    shares: Vec<f64>,
    other_shares: Vec<f64>,
    weights: Weights,
    /// Logarithm of the factor by which each particle's weight pays for its proposal.
    paid: Vec<f64>,
    increments: Vec<f64>,
    ancestors: Vec<u32>,
    predicted: Vec<f64>,
    /// Predicted mass of each group, at the index of its first mode; and the probabilities by
    /// which one is drawn.
    mass: Vec<f64>,
    proposed: Vec<f64>,
    leave: Option<f64>,
    is_fixed: bool,
    posterior: Vec<f64>,
}

impl<M: Sampled> Hierarchical<M> {
    /// A filter of `count` particles, at least 1. `abstract_nodes` lists the modes below each
    /// abstract node, those of nodes below it included; modes below none stand for themselves.
    ///
    /// # Errors
    /// [`HierarchyError`] naming the node.
    pub fn new(
        model: M,
        abstract_nodes: &[Vec<usize>],
        resampling: Resampling,
        count: usize,
        seed: u64,
    ) -> Result<Self, HierarchyError> {
        hybrid::check(&model)?;
        let (count, modes) = (count.max(1), model.modes());
        let (nodes, above) = arrange(&model, abstract_nodes)?;
        let mut rng = Pcg64Mcg::seed_from_u64(seed);
        let state = model.draw(0, &mut rng);
        let mut filter = Self {
            nodes,
            above,
            resampling,
            rng,
            count_max: count,
            allowed: count,
            states: vec![state; count],
            other_states: vec![state; count],
            shares: vec![0.0; count * modes],
            other_shares: vec![0.0; count * modes],
            weights: Weights::equal(count),
            paid: vec![0.0; count],
            increments: vec![0.0; count],
            ancestors: vec![0; count],
            predicted: vec![0.0; modes],
            mass: vec![0.0; modes],
            proposed: vec![0.0; modes],
            leave: None,
            is_fixed: false,
            posterior: vec![0.0; modes],
            model,
        };
        filter.reset();
        Ok(filter)
    }

    /// Begins anew from the prior and with the generator at `seed`, so that equal runs have equal
    /// beliefs.
    pub fn restart(&mut self, seed: u64) {
        self.rng = Pcg64Mcg::seed_from_u64(seed);
        self.reset();
    }

    /// Sets the number of particles, 1 to the number of the start, from the next step on. Fewer
    /// cost less; they are resampled from those there are.
    pub fn limit(&mut self, count: usize) {
        self.allowed = count.clamp(1, self.count_max);
    }

    /// The model, to give it the command of the next step.
    pub const fn model_mut(&mut self) -> &mut M {
        &mut self.model
    }

    /// State, share of each mode and weight of each particle; the weights sum to 1.
    pub fn particles(&self) -> impl Iterator<Item = (&M::State, &[f64], f64)> {
        let rows = self.shares.chunks_exact(self.model.modes());
        let particles = self.states.iter().zip(rows).zip(self.weights.linear());
        particles.map(|((state, shares), &weight)| (state, shares, weight))
    }

    /// Raises proposals: a share `leave` (0 to 1) of the draws leaves the particle's node for the
    /// others that it can reach, in equal parts. Weights pay for it.
    #[must_use]
    pub fn with_raised_proposals(mut self, leave: f64) -> Self {
        self.leave = Some(leave.clamp(0.0, 1.0));
        self
    }

    /// Merges all nodes for good, or splits all: the baselines of the rule.
    #[must_use]
    pub fn with_fixed_resolution(mut self, merged: bool) -> Self {
        self.is_fixed = true;
        for node in &mut self.nodes {
            node.merged = merged;
        }
        self
    }

    /// The mode that stands for `k` at present: itself, or the first leaf of the highest abstract
    /// node above it whose leaves are tracked together.
    fn group(&self, k: usize) -> usize {
        let merged = self.above[k].iter().find(|&&node| self.nodes[node].merged);
        merged.map_or(k, |&node| self.nodes[node].leaves[0])
    }

    /// Draws the group of particle i for the next step and fills `predicted` with the shares in it.
    /// Returns the logarithm of the factor by which the weight pays for the proposal.
    fn predict_shares(&mut self, i: usize) -> f64 {
        let modes = self.model.modes();
        let row = &self.shares[i * modes..(i + 1) * modes];
        self.predicted.fill(0.0);
        for (from, share) in row.iter().enumerate().filter(|(_, share)| **share > 0.0) {
            for (to, predicted) in self.predicted.iter_mut().enumerate() {
                *predicted += share * hybrid::transition(&self.model, from, to);
            }
        }
        let own = row.iter().position(|&share| share > 0.0).unwrap_or(0);
        self.mass.fill(0.0);
        for k in 0..modes {
            let group = self.group(k);
            self.mass[group] += self.predicted[k];
        }
        let drawn = self.propose(self.group(own));
        let mass = self.mass[drawn];
        for k in 0..modes {
            let stays = self.group(k) == drawn;
            self.predicted[k] = if stays { self.predicted[k] / mass } else { 0.0 };
        }
        if mass > 0.0 && mass.is_finite() {
            (mass / self.proposed[drawn]).ln()
        } else {
            // A chain that has changed since its check may lead nowhere: the mode stays.
            self.predicted.fill(0.0);
            self.predicted[own] = 1.0;
            f64::NEG_INFINITY
        }
    }

    /// Draws a group by `proposed`, which follows from the groups' masses.
    fn propose(&mut self, own: usize) -> usize {
        self.proposed.copy_from_slice(&self.mass);
        let others = self.mass.iter().enumerate();
        let others = others.filter(|&(k, mass)| k != own && *mass > 0.0).count();
        if let (Some(leave), 1..) = (self.leave, others) {
            let leave = if self.mass[own] > 0.0 { leave } else { 1.0 };
            for (k, (q, mass)) in self.proposed.iter_mut().zip(&self.mass).enumerate() {
                *q = match *mass > 0.0 {
                    _ if k == own => 1.0 - leave,
                    true => leave / others as f64,
                    false => 0.0,
                };
            }
        }
        draw(&self.proposed, &mut self.rng)
    }

    /// Moves particle i and conditions its shares; returns the logarithm of its weight's factor.
    fn move_particle(&mut self, i: usize, z: &M::Observation) -> f64 {
        let modes = self.model.modes();
        let leaf = draw(&self.predicted, &mut self.rng);
        let before = self.states[i];
        let after = self.model.propagate(leaf, &before, &mut self.rng);
        self.states[i] = after;
        let row = &mut self.shares[i * modes..(i + 1) * modes];
        if self.predicted[leaf] >= 1.0 {
            row.copy_from_slice(&self.predicted);
            return self.model.log_likelihood(leaf, &after, z);
        }
        // Motion relative to the drawn leaf's, so that nothing underflows.
        let reference = self.model.log_motion(leaf, &before, &after);
        let (mut moved, mut highest) = (0.0, f64::NEG_INFINITY);
        for (k, share) in row.iter_mut().enumerate() {
            *share = f64::NEG_INFINITY;
            if self.predicted[k] > 0.0 {
                let motion = self.model.log_motion(k, &before, &after) - reference;
                let prior = self.predicted[k] * motion.exp();
                moved += prior;
                *share = prior.ln() + self.model.log_likelihood(k, &after, z);
                highest = highest.max(*share);
            }
        }
        if !(highest.is_finite() && moved.is_finite() && moved > 0.0) {
            row.copy_from_slice(&self.predicted);
            return f64::NEG_INFINITY;
        }
        let mut total = 0.0;
        for share in row.iter_mut() {
            let value = (*share - highest).exp();
            *share = if value.is_nan() { 0.0 } else { value };
            total += *share;
        }
        for share in row.iter_mut() {
            *share /= total;
        }
        highest + total.ln() - moved.ln()
    }

    fn sum_modes(&mut self) {
        let modes = self.model.modes();
        self.posterior.fill(0.0);
        for (row, weight) in self.shares.chunks_exact(modes).zip(self.weights.linear()) {
            for (p, share) in self.posterior.iter_mut().zip(row) {
                *p += weight * share;
            }
        }
        let total: f64 = self.posterior.iter().sum();
        assert!(
            (total - 1.0).abs() <= SUM_TOLERANCE,
            "shares of a particle and weights of all each sum to one"
        );
        for p in &mut self.posterior {
            *p /= total;
        }
    }

    fn resample(&mut self) {
        let modes = self.model.modes();
        let weights = self.weights.linear();
        self.ancestors.resize(self.allowed, 0);
        self.other_shares.resize(self.allowed * modes, 0.0);
        self.other_states.resize(self.allowed, self.states[0]);
        if !systematic(weights, self.rng.random(), &mut self.ancestors) {
            return;
        }
        for (i, &ancestor) in self.ancestors.iter().enumerate() {
            let from = ancestor as usize;
            self.other_states[i] = self.states[from];
            let row = &self.shares[from * modes..(from + 1) * modes];
            self.other_shares[i * modes..(i + 1) * modes].copy_from_slice(row);
        }
        std::mem::swap(&mut self.states, &mut self.other_states);
        std::mem::swap(&mut self.shares, &mut self.other_shares);
        self.weights.level(self.states.len());
    }

    /// Splits and merges nodes by the rule above, one level at a time.
    fn choose_resolution(&mut self) {
        if self.is_fixed {
            return;
        }
        let count = self.states.len() as f64;
        for index in 0..self.nodes.len() {
            let node = &self.nodes[index];
            let mass = |leaves: &[usize]| leaves.iter().map(|&k| self.posterior[k]).sum::<f64>();
            let nodes = node
                .nodes_below
                .iter()
                .map(|&n| mass(&self.nodes[n].leaves));
            let leaves = node.leaves_below.iter().map(|&k| self.posterior[k]);
            let (total, largest) = (mass(&node.leaves), leaves.chain(nodes).fold(0.0, f64::max));
            let is_parent_of_merged = node.nodes_below.iter().all(|&n| self.nodes[n].merged);
            let is_populated = total * count >= PARTICLES_MIN;
            if node.merged && is_populated && largest > SPLIT * total {
                self.nodes[index].merged = false;
                self.split(index);
            } else if !node.merged
                && is_parent_of_merged
                && (!is_populated || largest < MERGE * total)
            {
                self.nodes[index].merged = true;
            }
        }
    }

    /// Each particle of a node moves to a group directly below it, drawn by its shares.
    fn split(&mut self, node: usize) {
        let modes = self.model.modes();
        for i in 0..self.states.len() {
            let row = &self.shares[i * modes..(i + 1) * modes];
            let first = row.iter().position(|&share| share > 0.0).unwrap_or(0);
            if !self.above[first].contains(&node) || row[first] >= 1.0 {
                continue;
            }
            let drawn = draw(row, &mut self.rng);
            let group = self.group(drawn);
            let mut kept = 0.0;
            for k in 0..modes {
                let stays = self.group(k) == group;
                let share = &mut self.shares[i * modes + k];
                *share = if stays { *share } else { 0.0 };
                kept += *share;
            }
            for share in &mut self.shares[i * modes..(i + 1) * modes] {
                *share /= kept;
            }
        }
    }
}

/// Index drawn by probabilities that sum to 1.
fn draw(p: &[f64], rng: &mut Pcg64Mcg) -> usize {
    let mut left = rng.random::<f64>();
    let mut last = 0;
    for (k, p) in p.iter().enumerate().filter(|(_, p)| **p > 0.0) {
        last = k;
        left -= p;
        if left < 0.0 {
            break;
        }
    }
    last
}

impl<M: Sampled> Filter for Hierarchical<M> {
    type Observation = M::Observation;

    fn step(&mut self, z: &M::Observation) -> Step {
        let count = self.states.len();
        for i in 0..count {
            self.paid[i] = self.predict_shares(i);
            self.increments[i] = self.paid[i] + self.move_particle(i, z);
        }
        let updated = self.weights.absorb(&self.increments[..count]);
        if updated.is_none() {
            // Predicted, not updated: the draws are paid for all the same.
            self.weights.absorb(&self.paid[..count]);
        }
        self.sum_modes();
        let effective_sample_size = self.weights.effective_sample_size();
        if self.resampling.is_due(effective_sample_size, count) || count != self.allowed {
            self.resample();
        }
        self.choose_resolution();
        Step {
            log_evidence: updated.unwrap_or(0.0),
            effective_sample_size,
            event: updated.is_none().then_some(Event::Coasted),
        }
        .checked(&self.posterior, count)
    }

    fn posterior(&self) -> &[f64] {
        &self.posterior
    }

    fn reset(&mut self) {
        let modes = self.model.modes();
        for node in self.nodes.iter_mut().filter(|_| !self.is_fixed) {
            node.merged = true;
        }
        for mode in 0..modes {
            self.predicted[mode] = self.model.initial(mode);
        }
        self.weights.level(self.states.len());
        self.shares.fill(0.0);
        for i in 0..self.states.len() {
            let mode = draw(&self.predicted, &mut self.rng);
            self.states[i] = self.model.draw(mode, &mut self.rng);
            self.shares[i * modes + mode] = 1.0;
        }
        self.sum_modes();
    }
}

#[cfg(test)]
mod tests;
