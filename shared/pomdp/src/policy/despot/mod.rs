//! DESPOT: a plan for the present belief, searched for while time is left.
//!
//! K scenarios of a belief, each a state with a weight, make the future a tree of actions and
//! observations (Somani et al. 2013). Upper bounds of its leaves are fast informed. Lower ones are
//! those of plans that are known: to do one thing for ever, or what a solver has found so far. A
//! search improves both where they matter most for the best action.
//!
//! Two things differ from the paper. Scenarios are sampled only where a belief has more than K
//! states. Every one counts after every observation, by its likelihood (Garg et al. 2019): rare
//! events are not missed, and in small models the plan is exact. A trial looks one step further at
//! one leaf, the one with the widest gap that the most promising actions may lead to (Ross et al.
//! 2008): so its cost is bounded.
//!
//! A tree is dropped when the belief moves. What is planned depends on the belief that it began
//! with, the seed and the number of trials; not on earlier beliefs, and not on a clock.

mod generator;
mod options;
mod scenarios;
mod tree;

pub use options::{DespotError, DespotOptions};

use super::{Choice, PointBased, Policy, Votes, choose};
use crate::bounds::mdp::Solution;
use crate::model::Pomdp;
use generator::Generator;
use scenarios::Sampler;
use tree::{Limits, Tree};

/// A plan stands while the belief moves by no more than this, half the sum of absolute differences.
/// Chosen by hand: far below the error of some hundred scenarios. Larger saves searches; smaller
/// plans anew for rounding.
const STANDS: f64 = 1e-3;

/// Trials that are taken up again at most: a full tree grows no more.
const SEARCHED_MAX: usize = 1 << 24;

/// Plans for one belief after another; all memory is allocated by [`Despot::new`].
///
/// The value of an action is its lower bound: what the best plan found that begins with it earns in
/// the scenarios.
#[derive(Debug, Clone)]
pub struct Despot {
    trials: usize,
    generator: Generator,
    sampler: Sampler,
    tree: Tree,
    /// What the tree is for; nothing before the first decision.
    belief: Vec<f64>,
    is_planned: bool,
    /// True if the search for this belief began with the last decision.
    is_fresh: bool,
    /// Trials for this belief so far.
    searched: usize,
    votes: Votes,
}

impl Despot {
    /// For a model, of which `solution` is the fully observable relaxation; `solved` are plans that
    /// the search may end with.
    ///
    /// # Errors
    /// [`DespotError`].
    pub fn new(
        model: &Pomdp,
        solution: &Solution,
        solved: Option<&PointBased>,
        options: &DespotOptions,
    ) -> Result<Self, DespotError> {
        options.check()?;
        let (nodes, depth) = (options.nodes, options.depth);
        let scenarios = options.scenarios.min(model.states().len());
        let bytes = Tree::bytes(nodes, scenarios);
        if bytes > options::BYTES_MAX {
            return Err(DespotError::Memory {
                nodes,
                scenarios,
                bytes,
            });
        }
        let generator = Generator::new(model, solution, solved)?;
        let limits = Limits {
            nodes,
            depth,
            cost: options.regularisation,
        };
        Ok(Self {
            trials: options.trials,
            sampler: Sampler::new(scenarios, options.seed),
            tree: Tree::new(&generator, scenarios, limits),
            belief: vec![0.0; model.states().len()],
            is_planned: false,
            is_fresh: false,
            searched: 0,
            votes: Votes::new(solution),
            generator,
        })
    }

    /// Goes on with the search for the belief of the last decision. False once there is nothing to
    /// gain, or no room.
    pub fn search(&mut self, trials: usize) -> bool {
        self.searched = self.searched.saturating_add(trials);
        (0..trials).all(|_| self.tree.grow(&self.generator, &mut self.sampler))
    }

    /// Lower and upper bound of what the best plan earns in the scenarios; `None` before the first
    /// decision.
    #[must_use]
    pub fn bounds(&self) -> Option<(f64, f64)> {
        self.tree.root().map(|root| (root.lower, root.upper))
    }

    /// As [`Self::bounds`], of plans that begin with an action; `None` also before the first trial.
    #[must_use]
    pub fn action_bounds(&self, action: usize) -> Option<(f64, f64)> {
        let bracket = self.tree.action(action)?;
        Some((bracket.lower, bracket.upper))
    }

    /// Begins a tree for `belief`, unless the one that there is will do; true if it did.
    fn plan(&mut self, belief: &[f64]) -> bool {
        let moves = belief.iter().zip(&self.belief).map(|(a, b)| (a - b).abs());
        if self.is_planned && 0.5 * moves.sum::<f64>() <= STANDS {
            return false;
        }
        self.take(belief);
        self.plant();
        self.search(self.trials);
        true
    }

    /// Begins a tree for the belief that was taken.
    fn plant(&mut self) {
        self.tree
            .plant(&self.generator, &mut self.sampler, &self.belief);
        self.is_planned = true;
        self.searched = 0;
    }

    /// Entries that are no positive number count as 0; a belief of nothing else as uniform.
    fn take(&mut self, belief: &[f64]) {
        self.belief.fill(0.0);
        for (ours, b) in self.belief.iter_mut().zip(belief) {
            *ours = if b.is_finite() { b.max(0.0) } else { 0.0 };
        }
        let sum: f64 = self.belief.iter().sum();
        if sum >= f64::MIN_POSITIVE && sum.is_finite() {
            self.belief.iter_mut().for_each(|b| *b /= sum);
        } else {
            let count = self.belief.len() as f64;
            self.belief.fill(1.0 / count);
        }
    }
}

impl Policy for Despot {
    fn evaluate(&mut self, belief: &[f64], values: &mut [f64]) -> Choice {
        self.is_fresh |= self.plan(belief);
        for (action, value) in values.iter_mut().enumerate() {
            let bracket = self.tree.action(action);
            *value = bracket.map_or(f64::NEG_INFINITY, |bracket| bracket.lower);
        }
        // Plans without a search: no node, no cost.
        let actions = self.generator.actions;
        for (plan, action) in self.generator.plans().iter().enumerate() {
            let scenarios = self.tree.root_scenarios().iter();
            let worth: f64 = scenarios
                .map(|(state, weight)| weight * self.generator.bounds(*state)[actions + plan])
                .sum();
            if let Some(value) = values.get_mut(*action as usize) {
                *value = value.max(worth);
            }
        }
        choose(values, self.votes.count(belief))
    }

    fn improve(&mut self, belief: &[f64]) {
        // A belief that is new to this decision has had its share.
        if !std::mem::take(&mut self.is_fresh) && !self.plan(belief) {
            self.search(self.trials);
        }
    }

    fn reset(&mut self) {
        self.is_planned = false;
        self.is_fresh = false;
    }

    /// The tree follows from the belief and the trials.
    fn keep(&self, put: &mut dyn FnMut(f64)) {
        put(f64::from(u8::from(self.is_planned)));
        put(f64::from(u8::from(self.is_fresh)));
        put(self.searched as f64);
        self.belief.iter().for_each(|b| put(*b));
    }

    fn resume(&mut self, take: &mut dyn FnMut() -> f64) {
        let is_planned = take() != 0.0;
        self.is_fresh = take() != 0.0;
        let searched = (take() as usize).min(SEARCHED_MAX);
        self.belief.iter_mut().for_each(|b| *b = take());
        self.is_planned = false;
        if is_planned {
            self.plant();
            self.search(searched);
        }
    }
}
