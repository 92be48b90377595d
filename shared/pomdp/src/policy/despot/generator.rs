//! The model as a search needs it: what can be observed in a state, and what plans are worth in it,
//! side by side.

use crate::bounds::{ActionValues, SolveError, blind, fib, mdp};
use crate::budget::Budget;
use crate::model::Pomdp;
use crate::policy::PointBased;

/// Rows of (index, number), of any length.
#[derive(Debug, Clone, Default)]
struct Table {
    ends: Vec<usize>,
    entries: Vec<(u32, f64)>,
}

impl Table {
    fn row(&self, row: usize) -> &[(u32, f64)] {
        let end = |row: usize| self.ends.get(row).copied().unwrap_or(0);
        let first = if row == 0 { 0 } else { end(row - 1) };
        self.entries.get(first..end(row)).unwrap_or_default()
    }

    fn end_row(&mut self) {
        self.ends.push(self.entries.len());
    }
}

/// The model, and its bounds state by state.
#[derive(Debug, Clone)]
pub(super) struct Generator {
    pub states: usize,
    pub actions: usize,
    pub observations: usize,
    pub discount: f64,
    /// For (a, s) at a * states + s: (s', T(s,a,s')).
    successors: Table,
    /// For (a, s') at a * states + s': (z, Z(a,s',z)), z ascending.
    observed: Table,
    /// R(s,a) at a * states + s.
    rewards: Vec<f64>,
    /// For each state: the upper bound of every action, then the value of every plan.
    bounds: Vec<f64>,
    /// The action that each plan begins with.
    plans: Vec<u32>,
}

impl Generator {
    /// With the fast informed bound above, or Q-MDP's where that is too large, and below it the
    /// blind policies and the plans of `solved`.
    ///
    /// # Errors
    /// [`SolveError`] if a bound cannot be found.
    pub(super) fn new(
        model: &Pomdp,
        solution: &mdp::Solution,
        solved: Option<&PointBased>,
    ) -> Result<Self, SolveError> {
        let (n, actions) = (model.states().len(), model.actions().len());
        let mut never = || false;
        let budget = &mut Budget::new(&mut never);
        let upper = match fib::solve_from(model, solution, budget) {
            Err(SolveError::Entries(_)) => relaxed(model, solution),
            upper => upper?,
        };
        let lower = blind::solve(model, budget)?;
        let of_solver = |s| solved.map_or(&[][..], |solved| solved.column(s));
        let mut bounds = Vec::with_capacity(n * (2 * actions + of_solver(0).len()));
        for s in 0..n {
            bounds.extend(upper.rows().filter_map(|row| row.get(s)));
            bounds.extend(lower.rows().filter_map(|row| row.get(s)));
            bounds.extend(of_solver(s));
        }
        let first_actions = solved.map_or(&[][..], PointBased::first_actions).iter();
        let plans = (0..actions).chain(first_actions.copied());
        let pairs = (0..actions).flat_map(|a| (0..n).map(move |s| (s, a)));
        Ok(Self {
            states: n,
            actions,
            observations: model.observations().len(),
            discount: model.discount(),
            successors: successors(model),
            observed: observed(model),
            rewards: pairs.map(|(s, a)| model.reward(s, a)).collect(),
            bounds,
            plans: plans.map(|action| action as u32).collect(),
        })
    }

    /// R(s,a).
    pub(super) fn reward(&self, state: u32, action: usize) -> f64 {
        self.rewards[action * self.states + state as usize]
    }

    /// (s', T(s,a,s')).
    pub(super) fn successors(&self, state: u32, action: usize) -> &[(u32, f64)] {
        self.successors.row(action * self.states + state as usize)
    }

    /// (z, Z(a,s',z)) of what can be observed; z ascends.
    pub(super) fn observed(&self, next: u32, action: usize) -> &[(u32, f64)] {
        self.observed.row(action * self.states + next as usize)
    }

    /// Z(a,s',z).
    pub(super) fn likelihood(&self, next: u32, action: usize, observation: u32) -> f64 {
        let row = self.observed(next, action);
        let found = row.binary_search_by_key(&observation, |(z, _)| *z);
        found.map_or(0.0, |at| row[at].1)
    }

    /// Upper bounds of a state's actions, then values of its plans.
    pub(super) fn bounds(&self, state: u32) -> &[f64] {
        let width = self.width();
        &self.bounds[state as usize * width..][..width]
    }

    /// Numbers of [`Self::bounds`].
    pub(super) const fn width(&self) -> usize {
        self.actions + self.plans.len()
    }

    /// The action that each plan begins with.
    pub(super) fn plans(&self) -> &[u32] {
        &self.plans
    }
}

/// The largest of some numbers.
pub(super) fn largest(values: &[f64]) -> f64 {
    values.iter().copied().fold(f64::NEG_INFINITY, f64::max)
}

fn relaxed(model: &Pomdp, solution: &mdp::Solution) -> ActionValues {
    let rows = (0..model.actions().len()).flat_map(|a| solution.q_of(a));
    let values = rows.map(|q| q + solution.error());
    ActionValues::new(model.states().len(), values.collect())
}

fn successors(model: &Pomdp) -> Table {
    let mut table = Table::default();
    for a in 0..model.actions().len() {
        for s in 0..model.states().len() {
            let row = model.successors(s, a).iter();
            table.entries.extend(row.map(|(to, p)| (*to as u32, *p)));
            table.end_row();
        }
    }
    table
}

fn observed(model: &Pomdp) -> Table {
    let mut table = Table::default();
    for a in 0..model.actions().len() {
        for s in 0..model.states().len() {
            for z in 0..model.observations().len() {
                let p = model.likelihood(a, z)[s];
                if p > 0.0 {
                    table.entries.push((z as u32, p));
                }
            }
            table.end_row();
        }
    }
    table
}
