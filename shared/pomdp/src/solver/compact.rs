//! A small policy from a large one.
//!
//! A search leaves as many vectors as it took to narrow the gap; most of them differ by little at
//! the beliefs that matter. The few are kept that lose least there. What they lose in all follows
//! from the vectors that they were chosen from: let W(b) be the best of all of them, and e(b) what
//! the best of the few is below it. As a vector is worth no more than a step of its plan and W
//! afterwards, the policy of the few earns W(b0) less the sum of its discounted e along its way, at
//! least. That sum is sampled over runs of the policy; beliefs at which it loses give it further
//! vectors.

use std::cmp::Reverse;
use std::collections::BinaryHeap;

use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;

use super::followers::Followers;
use crate::alpha_vectors::{AlphaVectors, VectorError};
use crate::bounds::SolveError;
use crate::budget::{Budget, StopRequest};
use crate::model::Pomdp;
use crate::sparse_beliefs::{SparseBeliefs, dot, sparse};

/// Beliefs at which vectors are compared, at most. Chosen by hand, as are the next two: together
/// they bound the time that choosing takes to some seconds.
const BELIEFS_MAX: usize = 5000;
/// Multiplications of valuing beliefs with all vectors, at most, and so of the runs of a round.
const PRODUCTS_MAX: usize = 1_000_000_000;
/// Steps of the runs of a round, at most.
const STEPS_MAX: usize = 200_000;
/// Runs of a round, at least: a run that would take too large a share is cut off. Chosen by hand:
/// fewer say little about their standard error.
const RUNS_MIN: usize = 20;
/// A run ends where the discount has fallen below this.
const DISCOUNT_MIN: f64 = 1e-4;
/// Times that further vectors are chosen after runs.
const ROUNDS_MAX: usize = 5;
/// A certain state weighs this little among the beliefs that are reached: a live belief may be any.
const CORNER_WEIGHT: f64 = 1e-3;
/// A loss below this, relative to the largest value, is none.
const ROUNDING: f64 = 1e-9;

/// A small policy.
#[derive(Debug, Clone, PartialEq)]
pub struct Compact {
    /// Its vectors, some of those that it was chosen from.
    pub vectors: AlphaVectors,
    /// What the policy earns less than all of them promise, from the start belief, at most: the
    /// mean over sampled runs, in units of reward.
    pub loss_mean: f64,
    /// Standard error of the mean.
    pub loss_error: f64,
}

/// Standard errors by which the loss of a small policy is thought to be more than in the sample.
const LOSS_ERRORS: f64 = 4.0;

impl Compact {
    /// What the policy loses, by a wide margin: the mean and four standard errors.
    #[must_use]
    pub fn loss_max(&self) -> f64 {
        self.loss_mean + LOSS_ERRORS * self.loss_error
    }
}

/// A policy of at most `vectors_max` of `vectors`. With discount 1 it is all of them if so few do
/// not come to an end. Equal inputs give equal policies.
///
/// # Errors
/// [`SolveError::Stopped`] if the budget ends.
pub fn compact(
    model: &Pomdp,
    vectors: &AlphaVectors,
    vectors_max: usize,
    budget: &mut Budget<'_>,
) -> Result<Compact, SolveError> {
    if vectors.len() <= vectors_max {
        return Ok(Compact {
            vectors: vectors.clone(),
            loss_mean: 0.0,
            loss_error: 0.0,
        });
    }
    let mut choice = Choice::new(model, vectors);
    let mut beliefs = choice.reach(budget)?;
    choice.add(&beliefs, vectors_max.max(1), budget)?;
    let mut losses = choice.run(0, budget)?;
    for round in 1..=ROUNDS_MAX as u64 {
        let before = choice.kept.len();
        beliefs = std::mem::take(&mut losses.beliefs);
        choice.add(&beliefs, vectors_max.max(1), budget)?;
        if choice.kept.len() == before {
            break;
        }
        // Other runs than those that the vectors were chosen by.
        losses = choice.run(round, budget)?;
    }
    if !losses.mean.is_finite() {
        return Ok(Compact {
            vectors: vectors.clone(),
            loss_mean: 0.0,
            loss_error: 0.0,
        });
    }
    let vectors = choice
        .vectors()
        .map_err(|_| SolveError::Unbounded(model.discount()))?;
    Ok(Compact {
        vectors,
        loss_mean: losses.mean,
        loss_error: losses.error,
    })
}

type SparseBelief = Vec<(u32, f64)>;

/// What was lost in runs.
struct Losses {
    mean: f64,
    error: f64,
    /// Where.
    beliefs: Vec<SparseBelief>,
}

/// All vectors, and those that are kept.
struct Choice<'m> {
    model: &'m Pomdp,
    plans: Vec<(usize, &'m [f64])>,
    kept: Vec<usize>,
    followers: Followers,
    /// Largest value of a vector, by size.
    scale: f64,
}

impl<'m> Choice<'m> {
    fn new(model: &'m Pomdp, vectors: &'m AlphaVectors) -> Self {
        let plans: Vec<(usize, &[f64])> = vectors.rows().collect();
        let values = plans.iter().flat_map(|(_, alpha)| alpha.iter());
        Self {
            model,
            scale: values.fold(0.0, |most, value| most.max(value.abs())),
            plans,
            kept: Vec::new(),
            followers: Followers::new(model),
        }
    }

    fn vectors(&self) -> Result<AlphaVectors, VectorError> {
        let kept = self
            .kept
            .iter()
            .filter_map(|at| self.plans.get(*at).copied());
        AlphaVectors::new(self.model.states().len(), self.model.actions().len(), kept)
    }

    /// The best of all plans, and its value.
    fn best(&self, belief: &[(u32, f64)]) -> (usize, f64) {
        largest(self.plans.iter().map(|(_, alpha)| dot(alpha, belief)))
    }

    /// The best of the plans that are kept, and its value.
    fn best_kept(&self, belief: &[(u32, f64)]) -> (usize, f64) {
        let values = self.kept.iter().map(|at| dot(self.plans[*at].1, belief));
        let (at, value) = largest(values);
        (self.kept[at], value)
    }

    /// Beliefs that valuing with all plans leaves time for.
    fn beliefs_max(&self) -> usize {
        let products = self.plans.len() * self.model.states().len();
        BELIEFS_MAX.min(PRODUCTS_MAX / products.max(1)).max(1)
    }

    /// The beliefs that the policy of all plans reaches, the most probable first: from the start,
    /// and, with little weight, from every certain state.
    fn reach(&mut self, budget: &mut Budget<'_>) -> Result<Vec<SparseBelief>, StopRequest> {
        let mut met = SparseBeliefs::default();
        // By weight; of equal ones the first that was met.
        let mut open = BinaryHeap::new();
        let mut is_done = Vec::new();
        let start = met.intern(&sparse(self.model.start()));
        open.push((1.0_f64.to_bits(), Reverse(start)));
        for state in 0..self.model.states().len() {
            let corner = met.intern(&[(state as u32, 1.0)]);
            open.push((CORNER_WEIGHT.to_bits(), Reverse(corner)));
        }
        let mut reached = Vec::new();
        while let Some((weight, Reverse(id))) = open.pop() {
            is_done.resize(met.len(), false);
            if std::mem::replace(&mut is_done[id as usize], true) {
                continue;
            }
            let belief = met.entries(id).to_vec();
            let action = self.plans[self.best(&belief).0].0;
            let weight = f64::from_bits(weight) * self.model.discount();
            let work = self
                .followers
                .each(self.model, &belief, action, |follower| {
                    let id = met.intern(follower.belief);
                    let weight = weight * follower.probability;
                    open.push((weight.to_bits(), Reverse(id)));
                    Ok(())
                })?;
            budget.spend(work + self.plans.len() * belief.len())?;
            reached.push(belief);
            if reached.len() == self.beliefs_max() {
                break;
            }
        }
        Ok(reached)
    }

    /// Keeps, again and again, the plan that is missed most at one of these beliefs.
    fn add(
        &mut self,
        beliefs: &[SparseBelief],
        vectors_max: usize,
        budget: &mut Budget<'_>,
    ) -> Result<(), StopRequest> {
        let mut all = Vec::with_capacity(beliefs.len());
        let mut held = Vec::with_capacity(beliefs.len());
        for belief in beliefs {
            all.push(self.best(belief));
            held.push(match self.kept.is_empty() {
                true => f64::NEG_INFINITY,
                false => self.best_kept(belief).1,
            });
            budget.spend(self.plans.len() * belief.len())?;
        }
        while self.kept.len() < vectors_max {
            let losses = all.iter().zip(&held).map(|((_, value), held)| value - held);
            let (at, loss) = largest(losses);
            if loss <= ROUNDING * self.scale || loss.is_nan() {
                break;
            }
            let plan = all[at].0;
            self.kept.push(plan);
            for (held, belief) in held.iter_mut().zip(beliefs) {
                *held = held.max(dot(self.plans[plan].1, belief));
                budget.spend(belief.len())?;
            }
        }
        Ok(())
    }

    /// Runs of the policy that is kept, from the start: what it loses, and where.
    fn run(&mut self, seed: u64, budget: &mut Budget<'_>) -> Result<Losses, StopRequest> {
        let mut random = Pcg64Mcg::seed_from_u64(seed);
        let (mut steps, began) = (0, budget.spent());
        let (mut sums, mut beliefs) = (Vec::new(), Vec::new());
        while steps < STEPS_MAX && budget.spent() < began + PRODUCTS_MAX as u64 {
            let (sum, taken) = self.run_once(&mut random, &mut beliefs, budget)?;
            sums.push(sum);
            steps += taken;
        }
        let count = sums.len() as f64;
        let mean = sums.iter().sum::<f64>() / count;
        let squares: f64 = sums.iter().map(|sum| (sum - mean).powi(2)).sum();
        Ok(Losses {
            mean,
            error: (squares / (count - 1.0).max(1.0) / count).sqrt(),
            beliefs,
        })
    }

    /// One run: what it loses, and its steps. What is left of one that is cut off is thought to
    /// lose in each step what its second half did; with discount 1, without bound.
    fn run_once(
        &mut self,
        random: &mut Pcg64Mcg,
        beliefs: &mut Vec<SparseBelief>,
        budget: &mut Budget<'_>,
    ) -> Result<(f64, usize), StopRequest> {
        let rest = 1.0 - self.model.discount();
        let work_max = budget.spent() + (PRODUCTS_MAX / RUNS_MIN) as u64;
        let mut belief = sparse(self.model.start());
        let (mut discount, mut sum) = (1.0, 0.0);
        let mut losses = Vec::new();
        while discount > DISCOUNT_MIN {
            if losses.len() >= STEPS_MAX / RUNS_MIN || budget.spent() >= work_max {
                let half = &losses[losses.len() / 2..];
                let mean = half.iter().sum::<f64>() / half.len().max(1) as f64;
                // Never ending costs something, by what a goal problem is.
                let left = if rest > 0.0 {
                    mean / rest
                } else {
                    f64::INFINITY
                };
                return Ok((sum + discount * left, losses.len()));
            }
            let (_, value) = self.best(&belief);
            let (plan, kept) = self.best_kept(&belief);
            let loss = (value - kept).max(0.0);
            sum += discount * loss;
            losses.push(loss);
            if loss > ROUNDING * self.scale && beliefs.len() < self.beliefs_max() {
                beliefs.push(belief.clone());
            }
            let action = self.plans[plan].0;
            let Some(next) = self.draw(&belief, action, random.random(), budget)? else {
                break;
            };
            discount *= self.model.discount();
            if rest > 0.0 && next == belief && self.stays(&belief, action, budget)? {
                // For ever.
                sum += discount * loss / rest;
                break;
            }
            belief = next;
        }
        Ok((sum, losses.len()))
    }

    /// True if no other belief may follow.
    fn stays(
        &mut self,
        belief: &SparseBelief,
        action: usize,
        budget: &mut Budget<'_>,
    ) -> Result<bool, StopRequest> {
        let mut stays = true;
        let work = self
            .followers
            .each(self.model, belief, action, |follower| {
                stays &= follower.belief == belief.as_slice();
                Ok(())
            })?;
        budget.spend(work)?;
        Ok(stays)
    }

    /// The belief that follows where a number between 0 and 1 says what is observed; none if that
    /// is a goal.
    fn draw(
        &mut self,
        belief: &[(u32, f64)],
        action: usize,
        number: f64,
        budget: &mut Budget<'_>,
    ) -> Result<Option<SparseBelief>, StopRequest> {
        let ends = |(s, _): &(u32, f64)| self.model.may_end(*s as usize, action);
        let may_end = belief.iter().any(ends);
        let (mut left, mut next) = (number, Vec::new());
        let work = self
            .followers
            .each(self.model, belief, action, |follower| {
                // Rounding may leave a little of the number: the last one it is then.
                if left >= 0.0 {
                    next.clear();
                    next.extend_from_slice(follower.belief);
                }
                left -= follower.probability;
                Ok(())
            })?;
        budget.spend(work + self.plans.len() * belief.len())?;
        Ok((left < 0.0 || !may_end).then_some(next))
    }
}

/// Index of the largest number, the first of equal ones, and the number.
fn largest(numbers: impl Iterator<Item = f64>) -> (usize, f64) {
    let first = (0, f64::NEG_INFINITY);
    let larger = |held: (usize, f64), new: (usize, f64)| if new.1 > held.1 { new } else { held };
    numbers.enumerate().fold(first, larger)
}
