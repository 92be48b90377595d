//! What a given policy earns.
//!
//! A policy that remembers nothing but the belief is a Markov chain over the beliefs that it
//! reaches. The most probable of them are gone through; the value at the start is a linear system,
//! in which the others are worth the smallest reward for ever, or what is earned by whoever knows
//! the state.

use std::cmp::Reverse;
use std::collections::BinaryHeap;

use super::followers::Followers;
use crate::bounds::linear::{Rows, System};
use crate::bounds::{SolveError, contraction, mdp};
use crate::budget::Budget;
use crate::model::Pomdp;
use crate::policy::Policy;
use crate::sparse_beliefs::{BeliefId, SparseBeliefs, dot, sparse};

/// The value of a policy at the start belief lies between these, in units of reward.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PolicyValue {
    /// The least that it may be.
    pub lower: f64,
    /// The most.
    pub upper: f64,
    /// Beliefs that were gone through.
    pub beliefs: usize,
    /// Discounted share of the time that is spent beyond them, at most 1.
    pub beyond: f64,
}

/// Goes through `beliefs_max` beliefs at most, of the chain that `policy` makes of `model`. The
/// policy must remember nothing: dual control does.
///
/// # Errors
/// [`SolveError::Unbounded`] for a discount of 1; [`SolveError::Stopped`] if the budget ends.
pub fn policy_value(
    model: &Pomdp,
    policy: &mut dyn Policy,
    beliefs_max: usize,
    budget: &mut Budget<'_>,
) -> Result<PolicyValue, SolveError> {
    let discount = model.discount();
    if discount >= 1.0 {
        return Err(SolveError::Unbounded(discount));
    }
    let best = mdp::solve_within(model, budget)?;
    let states = 0..model.states().len();
    let most = states.clone().map(|s| best.value(s) + best.error());
    let rewards = states.clone().flat_map(|s| {
        let actions = 0..model.actions().len();
        actions.map(move |a| model.reward(s, a))
    });
    let least = rewards.fold(f64::INFINITY, f64::min) / (1.0 - discount);
    let bounds = [vec![least; states.len()], most.collect()];
    let walk = Walk::new(model, policy, beliefs_max, budget)?;
    let chain = Chain::new(discount, walk, &bounds);
    let [lower, upper] = &chain.earned;
    let (lower, upper) = (chain.solve(lower, budget)?.0, chain.solve(upper, budget)?.1);
    let rest = discount / (1.0 - discount);
    let right: Vec<f64> = chain.beyond.iter().map(|p| p * rest).collect();
    let beyond = chain.solve(&right, budget)?.1 * (1.0 - discount);
    Ok(PolicyValue {
        lower,
        upper,
        beliefs: chain.beyond.len(),
        beyond: beyond.clamp(0.0, 1.0),
    })
}

/// The beliefs that were gone through, in order.
struct Chain {
    discount: f64,
    links: Rows,
    /// What a step earns, and what is earned where it leads beyond, discounted: at least and at
    /// most.
    earned: [Vec<f64>; 2],
    /// Probability with which a step leads beyond.
    beyond: Vec<f64>,
    /// Largest probability with which one does not.
    mass_max: f64,
}

/// One step of the chain: its reward, and the beliefs that follow with their probabilities.
type Step = (f64, Vec<(BeliefId, f64)>);

/// The beliefs that were met, and the steps from those that were gone through.
#[derive(Default)]
struct Walk {
    store: SparseBeliefs,
    /// For each belief its step, where it was gone through.
    place: Vec<Option<usize>>,
    steps: Vec<Step>,
}

impl Walk {
    fn new(
        model: &Pomdp,
        policy: &mut dyn Policy,
        beliefs_max: usize,
        budget: &mut Budget<'_>,
    ) -> Result<Self, SolveError> {
        let mut walk = Self::default();
        let mut followers = Followers::default();
        let root = walk.store.intern(&sparse(model.start()));
        walk.place.push(None);
        let mut values = vec![0.0; model.actions().len()];
        let mut dense = vec![0.0; model.states().len()];
        // By the probability of one way there; of equal ones the belief that was met first.
        let mut open = BinaryHeap::from([(1.0_f64.to_bits(), Reverse(root))]);
        while let Some((weight, Reverse(id))) = open.pop() {
            if walk.place[id as usize].is_some() {
                continue;
            }
            if walk.steps.len() == beliefs_max {
                break;
            }
            walk.place[id as usize] = Some(walk.steps.len());
            let belief = walk.store.entries(id).to_vec();
            dense.fill(0.0);
            belief.iter().for_each(|(s, b)| dense[*s as usize] = *b);
            let action = policy.evaluate(&dense, &mut values).action;
            let rewards = belief.iter();
            let reward = rewards.map(|(s, b)| b * model.reward(*s as usize, action));
            let reward: f64 = reward.sum();
            let mut next: Vec<(BeliefId, f64)> = Vec::new();
            let work = followers.each(model, &belief, action, |follower| {
                let id = walk.store.intern(follower.belief);
                next.push((id, follower.probability));
                Ok::<(), SolveError>(())
            })?;
            budget.spend(work + 20 * next.len())?;
            walk.place.resize(walk.store.len(), None);
            let weight = f64::from_bits(weight) * model.discount();
            for (id, p) in &next {
                if walk.place[*id as usize].is_none() {
                    open.push(((weight * p).to_bits(), Reverse(*id)));
                }
            }
            walk.steps.push((reward, next));
        }
        Ok(walk)
    }
}

impl Chain {
    /// `bounds` of what is earned in each state beyond the walk.
    fn new(discount: f64, walk: Walk, bounds: &[Vec<f64>; 2]) -> Self {
        let mut chain = Self {
            discount,
            links: Rows::default(),
            earned: [Vec::new(), Vec::new()],
            beyond: Vec::new(),
            mass_max: 0.0,
        };
        for (reward, next) in walk.steps {
            let (mut beyond, mut worth, mut mass) = (0.0, [0.0; 2], 0.0);
            for (id, p) in next {
                if let Some(to) = walk.place[id as usize] {
                    chain.links.push(to, p);
                    mass += p;
                    continue;
                }
                beyond += p;
                for (worth, bound) in worth.iter_mut().zip(bounds) {
                    *worth += discount * p * dot(bound, walk.store.entries(id));
                }
            }
            chain.links.end_row();
            chain.beyond.push(beyond);
            for (earned, worth) in chain.earned.iter_mut().zip(worth) {
                earned.push(reward + worth);
            }
            chain.mass_max = chain.mass_max.max(mass);
        }
        chain
    }

    /// The value at the start: no less than the first, no more than the second, which differ by
    /// what is left of the system's error.
    fn solve(&self, right: &[f64], budget: &mut Budget<'_>) -> Result<(f64, f64), SolveError> {
        let system = System {
            rows: &self.links,
            right,
            discount: self.discount,
        };
        let x = system.solve_roughly(vec![0.0; right.len()], budget)?;
        let left = system.residual(&x).into_iter();
        let error = left.fold(0.0_f64, |most, r| most.max(r.abs()));
        let error = error / (1.0 - contraction(self.discount, self.mass_max)?);
        if !error.is_finite() {
            return Err(SolveError::Unbounded(self.discount));
        }
        let first = x.first().copied().unwrap_or(0.0);
        Ok((first - error, first + error))
    }
}
