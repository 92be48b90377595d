//! The tighter informed bound (Krale et al., AAMAS 2025).

use super::informed::{ENTRIES_MAX, Mixtures};
use super::{ActionValues, SolveError, fib};
use crate::budget::Budget;
use crate::model::Pomdp;
use crate::sparse_beliefs::{BeliefId, SparseBeliefs, dot, sparse};

/// Q over the beliefs one step from the corners, ready to value any belief.
#[derive(Debug, Clone)]
pub struct Tib {
    states: usize,
    actions: usize,
    observations: usize,
    /// gamma p(o|s,a) Q(b_sao,a') at [a][o][a'][s].
    table: Vec<f64>,
    /// R(s,a) at [a][s].
    rewards: Vec<f64>,
    /// Which observations are possible after (s,a), a bit each: words at [a][s].
    possible: Vec<u64>,
}

impl Tib {
    /// Q(b,a) = R(b,a) + gamma sum_o max_a' sum_s b(s) p(o|s,a) Q(b_sao,a').
    #[must_use]
    pub fn q(&self, belief: &[f64], action: usize) -> f64 {
        self.q_sparse(&sparse(belief), action)
    }

    /// max_a Q(b,a): an upper bound of V*(b). `belief` has one probability a state.
    #[must_use]
    pub fn value(&self, belief: &[f64]) -> f64 {
        self.value_sparse(&sparse(belief))
    }

    pub(crate) fn value_sparse(&self, belief: &[(u32, f64)]) -> f64 {
        (0..self.actions)
            .map(|a| self.q_sparse(belief, a))
            .fold(f64::NEG_INFINITY, f64::max)
    }

    pub(crate) fn q_sparse(&self, belief: &[(u32, f64)], action: usize) -> f64 {
        let n = self.states;
        let worth = |row: &[f64]| dot(row, belief);
        let block = self.observations * self.actions * n;
        let table = &self.table[action * block..][..block];
        let words = self.observations.div_ceil(64);
        let mut next = 0.0;
        // Where part of the state is observed, few observations are possible at once.
        for word in 0..words {
            let of_state =
                |(s, _): &(u32, f64)| self.possible[(action * n + *s as usize) * words + word];
            let mut possible = belief.iter().map(of_state).fold(0, |all, one| all | one);
            while possible != 0 {
                let o = 64 * word + possible.trailing_zeros() as usize;
                possible &= possible - 1;
                let of_o = table[o * self.actions * n..][..self.actions * n].chunks(n);
                next += of_o.map(worth).fold(f64::NEG_INFINITY, f64::max);
            }
        }
        worth(&self.rewards[action * n..][..n]) + next
    }

    /// Work of one [`Self::q_sparse`] per entry of the belief.
    pub(crate) const fn work(&self) -> usize {
        self.observations * self.actions
    }
}

/// Where every (s, a, o) leads.
struct Steps {
    actions: usize,
    observations: usize,
    beliefs: SparseBeliefs,
    /// (belief, probability) at [s][a][o]; probability 0 for what cannot be observed.
    to: Vec<(BeliefId, f64)>,
}

impl Steps {
    fn new(model: &Pomdp, budget: &mut Budget<'_>) -> Result<Self, SolveError> {
        let (actions, observations) = (model.actions().len(), model.observations().len());
        let mut steps = Self {
            actions,
            observations,
            beliefs: SparseBeliefs::default(),
            to: Vec::with_capacity(model.states().len() * actions * observations),
        };
        let mut belief = Vec::new();
        for s in 0..model.states().len() {
            for a in 0..actions {
                let successors = model.moves(s, a);
                for o in 0..observations {
                    budget.spend(4 * successors.len())?;
                    let likelihood = model.likelihood(a, o);
                    belief.clear();
                    belief.extend(successors.iter().filter_map(|(to, p)| {
                        let w = p * likelihood[*to];
                        (w > 0.0).then_some((*to as u32, w))
                    }));
                    let mass: f64 = belief.iter().map(|(_, w)| w).sum();
                    if mass <= 0.0 {
                        steps.to.push((0, 0.0));
                        continue;
                    }
                    belief.iter_mut().for_each(|(_, w)| *w /= mass);
                    steps.to.push((steps.beliefs.intern(&belief), mass));
                }
            }
            if steps.beliefs.entry_count() > ENTRIES_MAX {
                return Err(SolveError::Entries(steps.beliefs.entry_count()));
            }
        }
        Ok(steps)
    }

    fn successors(&self, s: usize, a: usize) -> &[(BeliefId, f64)] {
        &self.to[(s * self.actions + a) * self.observations..][..self.observations]
    }

    /// Entries that the mixtures will have.
    fn entries(&self) -> usize {
        let states = self.to.len() / self.actions / self.observations;
        let branches: Vec<usize> = (0..states)
            .map(|s| {
                let all = (0..self.actions).flat_map(|a| self.successors(s, a));
                all.filter(|(_, p)| *p > 0.0).count()
            })
            .collect();
        let ids = 0..self.beliefs.len() as BeliefId;
        ids.flat_map(|id| self.beliefs.entries(id))
            .map(|(s, _)| branches[*s as usize])
            .sum()
    }

    fn mixtures(&self, model: &Pomdp, budget: &mut Budget<'_>) -> Result<Mixtures, SolveError> {
        let mut mixtures = Mixtures::new(self.actions);
        for id in 0..self.beliefs.len() as BeliefId {
            let belief = self.beliefs.entries(id);
            for a in 0..self.actions {
                budget.spend(self.observations * belief.len())?;
                let mut count = 0;
                for o in 0..self.observations {
                    let mut is_possible = false;
                    for (s, b) in belief {
                        let (to, p) = self.successors(*s as usize, a)[o];
                        if p > 0.0 {
                            mixtures.rows_mut().push(to as usize, b * p);
                            is_possible = true;
                        }
                    }
                    if is_possible {
                        mixtures.rows_mut().end_row();
                        count += 1;
                    }
                }
                let rewards = belief.iter().map(|(s, b)| b * model.reward(*s as usize, a));
                let may_end = belief.iter().any(|(s, _)| model.may_end(*s as usize, a));
                mixtures.end_pair(count, rewards.sum(), may_end);
            }
        }
        Ok(mixtures)
    }
}

/// Solves Q(b,a) = R(b,a) + gamma sum_o max_a' sum_s b(s) p(o|s,a) Q(b_sao,a') over the beliefs
/// one step from the corners, from the fast informed bound, below which it stays.
///
/// # Errors
/// [`SolveError`]; `Entries` if the model is too large for it.
pub fn solve(model: &Pomdp, budget: &mut Budget<'_>) -> Result<Tib, SolveError> {
    solve_from(model, &fib::solve(model, budget)?, budget)
}

/// As [`solve`], with the fast informed bound at hand.
///
/// # Errors
/// [`SolveError`]; `Entries` if the model is too large for it.
pub fn solve_from(
    model: &Pomdp,
    fast: &ActionValues,
    budget: &mut Budget<'_>,
) -> Result<Tib, SolveError> {
    let steps = Steps::new(model, budget)?;
    let (n, actions) = (model.states().len(), model.actions().len());
    let values = steps.to.len().saturating_mul(actions);
    let entries = steps.entries().max(values);
    if entries > ENTRIES_MAX {
        return Err(SolveError::Entries(entries));
    }
    let mixtures = steps.mixtures(model, budget)?;
    let ids = 0..steps.beliefs.len() as BeliefId;
    let guess = ids
        .flat_map(|id| (0..actions).map(move |a| (id, a)))
        .map(|(id, a)| dot(fast.values(a), steps.beliefs.entries(id)))
        .collect();
    let q = mixtures.solve(guess, model.discount(), budget)?;
    let mut table = Vec::with_capacity(n * actions * actions * steps.observations);
    for a in 0..actions {
        for o in 0..steps.observations {
            budget.spend(actions * n)?;
            for next in 0..actions {
                table.extend((0..n).map(|s| {
                    let (to, p) = steps.successors(s, a)[o];
                    // Without any step that goes on there is no belief at all.
                    let worth = q.get(to as usize * actions + next).unwrap_or(&0.0);
                    model.discount() * p * worth
                }));
            }
        }
    }
    let words = steps.observations.div_ceil(64);
    let mut possible = vec![0; actions * n * words];
    for (a, s) in (0..actions).flat_map(|a| (0..n).map(move |s| (a, s))) {
        for (o, _) in steps
            .successors(s, a)
            .iter()
            .enumerate()
            .filter(|(_, to)| to.1 > 0.0)
        {
            possible[(a * n + s) * words + o / 64] |= 1 << (o % 64);
        }
    }
    let pairs = (0..actions).flat_map(|a| (0..n).map(move |s| (a, s)));
    Ok(Tib {
        possible,
        states: n,
        actions,
        observations: steps.observations,
        table,
        rewards: pairs.map(|(a, s)| model.reward(s, a)).collect(),
    })
}
