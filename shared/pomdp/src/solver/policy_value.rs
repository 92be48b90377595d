//! What a given policy earns.
//!
//! A policy that remembers nothing but the belief is a Markov chain over the beliefs that it
//! reaches. The most probable of them are gone through; the value at the start is a linear system,
//! in which the others are worth the smallest reward for ever, or what is earned by whoever knows
//! the state. Beliefs that are merged, as they differ by rounding, widen the bounds by what that
//! may amount to.

use std::cmp::Reverse;
use std::collections::BinaryHeap;

use super::followers::Followers;
use super::initial::trivial;
use crate::bounds::linear::{Rows, System};
use crate::bounds::{SolveError, contraction, mdp};
use crate::budget::Budget;
use crate::model::Pomdp;
use crate::policy::Policy;
use crate::sparse_beliefs::{BeliefId, MERGED, SparseBeliefs, dot, sparse};

/// The value of a policy at the start belief lies between these, in units of reward.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PolicyValue {
    /// The least that it may be.
    pub lower: f64,
    /// The most.
    pub upper: f64,
    /// Beliefs that were gone through.
    pub beliefs: usize,
    /// Discounted share of the time that is spent beyond them, at most 1; with discount 1 the
    /// probability of getting there.
    pub beyond: f64,
}

/// Goes through `beliefs_max` beliefs at most, of the chain that `policy` makes of `model`. The
/// policy must remember nothing: dual control does. With discount 1 it is asked at beliefs under
/// the condition that no goal has been reached, and nothing is known of what is beyond.
///
/// # Errors
/// [`SolveError::Unbounded`] for a policy that never ends with discount 1, or what the model lacks
/// of a goal problem; [`SolveError::Stopped`] if the budget ends.
pub fn policy_value(
    model: &Pomdp,
    policy: &mut dyn Policy,
    beliefs_max: usize,
    budget: &mut Budget<'_>,
) -> Result<PolicyValue, SolveError> {
    let discount = model.discount();
    let best = mdp::solve_within(model, budget)?;
    let states = 0..model.states().len();
    let most: Vec<f64> = states
        .clone()
        .map(|s| best.value(s) + best.error())
        .collect();
    let highest = most.iter().fold(0.0_f64, |m, v| m.max(*v));
    // No policy earns more than who knows the state, nor less than the smallest reward for ever.
    let ceiling: f64 = model.start().iter().zip(&most).map(|(b, v)| b * v).sum();
    let floor = trivial(model).lower;
    let bounds = [vec![floor; states.len()], most];
    let walk = Walk::new(model, policy, beliefs_max, budget)?;
    let chain = Chain::new(discount, walk, &bounds);
    let [lower, upper] = &chain.earned;
    let beyond: Vec<f64> = chain.beyond.iter().map(|p| p * discount).collect();
    let beyond = chain.solve(&beyond, budget)?.1;
    let (steps, upper) = (chain.steps(budget)?, chain.solve(upper, budget)?.1);
    let lower = match lower.iter().all(|v| v.is_finite()) {
        true => chain.solve(lower, budget)?.0,
        false => f64::NEG_INFINITY,
    };
    // What merged beliefs differ by, and what rows of Z exceed 1 by, of all that is to come.
    let scale = upper
        .abs()
        .max(if lower.is_finite() { lower.abs() } else { 0.0 });
    let error = (MERGED + excess_mass(model)) * steps * (scale + 2.0 * highest);
    Ok(PolicyValue {
        lower: (lower - error).max(floor),
        upper: (upper + error).min(ceiling),
        beliefs: chain.beyond.len(),
        beyond: beyond.clamp(0.0, 1.0),
    })
}

/// What the rows of Z exceed 1 by, at most.
fn excess_mass(model: &Pomdp) -> f64 {
    let observations = 0..model.observations().len();
    let pairs =
        (0..model.actions().len()).flat_map(|a| (0..model.states().len()).map(move |s| (a, s)));
    let sum = |(a, s): (usize, usize)| -> f64 {
        let observations = observations.clone();
        observations.map(|z| model.likelihood(a, z)[s]).sum()
    };
    pairs
        .map(sum)
        .fold(0.0, |most, sum| f64::max(most, sum - 1.0))
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
        let mut followers = Followers::new(model);
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
        let first = |x: Vec<f64>| x.first().copied().unwrap_or(0.0);
        let system = System {
            rows: &self.links,
            right,
            discount: self.discount,
        };
        let guess = vec![0.0; right.len()];
        if self.discount >= 1.0 {
            let lower = system.solve_beside(-1.0, guess, budget)?;
            let upper = system.solve_beside(1.0, lower.clone(), budget)?;
            return Ok((first(lower), first(upper)));
        }
        let x = system.solve_roughly(guess, budget)?;
        let left = system.residual(&x).into_iter();
        let error = left.fold(0.0_f64, |most, r| most.max(r.abs()));
        let error = error / (1.0 - contraction(self.discount, self.mass_max)?);
        if !error.is_finite() {
            return Err(SolveError::Unbounded(self.discount));
        }
        let first = first(x);
        Ok((first - error, first + error))
    }

    /// Discounted number of steps among the beliefs.
    fn steps(&self, budget: &mut Budget<'_>) -> Result<f64, SolveError> {
        Ok(self.solve(&vec![1.0; self.beyond.len()], budget)?.1)
    }
}
