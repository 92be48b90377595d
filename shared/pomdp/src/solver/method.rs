//! All ways to bound the optimal value at the start belief, by name.

use std::fmt;
use std::str::FromStr;

use super::point_based::solve;
use super::report::{Bracket, EndReason, Options, Progress};
use crate::alpha_vectors::AlphaVectors;
use crate::bounds::{SolveError, blind, fib, mdp, tib};
use crate::budget::Budget;
use crate::model::Pomdp;

/// A way to bound the optimal value.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Method {
    /// The fully observable relaxation.
    Mdp,
    /// One action for ever.
    Blind,
    /// Q-MDP.
    QMdp,
    /// The fast informed bound.
    Fib,
    /// The tighter informed bound.
    Tib,
    /// The point-based solver.
    Sarsop,
}

/// Not a method.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("'{0}', allowed are mdp, blind, qmdp, fib, tib, sarsop")]
pub struct MethodError(String);

impl Method {
    /// All of them, the cheap ones first.
    pub const ALL: [Self; 6] = [
        Self::Blind,
        Self::Mdp,
        Self::QMdp,
        Self::Fib,
        Self::Tib,
        Self::Sarsop,
    ];

    const fn name(self) -> &'static str {
        match self {
            Self::Mdp => "mdp",
            Self::Blind => "blind",
            Self::QMdp => "qmdp",
            Self::Fib => "fib",
            Self::Tib => "tib",
            Self::Sarsop => "sarsop",
        }
    }
}

impl fmt::Display for Method {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

impl FromStr for Method {
    type Err = MethodError;

    fn from_str(name: &str) -> Result<Self, MethodError> {
        let found = Self::ALL.into_iter().find(|method| method.name() == name);
        found.ok_or_else(|| MethodError(name.to_owned()))
    }
}

/// What a method found.
#[derive(Debug, Clone, PartialEq)]
pub struct Answer {
    /// Lower bound at the start belief; none if the method gives none, or was stopped before.
    pub lower: Option<f64>,
    /// Upper bound at the start belief; none if the method gives none, or was stopped before.
    pub upper: Option<f64>,
    /// How far the search came; zeros for the other methods.
    pub progress: Progress,
    /// Why it ended: a method that is not a search and went to its end counts as precise.
    pub ended: EndReason,
    /// A policy that earns the lower bound, if the method gives one.
    pub vectors: Option<AlphaVectors>,
}

impl Answer {
    const fn new(lower: Option<f64>, upper: Option<f64>) -> Self {
        Self {
            lower,
            upper,
            progress: Progress {
                bracket: Bracket {
                    lower: f64::NEG_INFINITY,
                    upper: f64::INFINITY,
                },
                rounds: 0,
                vectors: 0,
                points: 0,
                beliefs: 0,
            },
            ended: EndReason::Precision,
            vectors: None,
        }
    }
}

/// Bounds the optimal value at the start belief. `options` and `watch` are for the search alone.
/// A budget that ends is not an error: what was found until then is the answer.
///
/// # Errors
/// [`SolveError`] for values without bound, and for a model that is too large for the method.
pub fn bound(
    method: Method,
    model: &Pomdp,
    options: &Options,
    budget: &mut Budget<'_>,
    watch: &mut dyn FnMut(&Progress),
) -> Result<Answer, SolveError> {
    let mut answer = Answer::new(None, None);
    let found = match method {
        Method::Blind => blind_answer(model, budget).map(|found| answer = found),
        Method::Mdp | Method::QMdp => mdp::solve_within(model, budget).map(|solution| {
            let value: f64 = if method == Method::Mdp {
                let terms = model.start().iter().enumerate();
                terms.map(|(s, b)| b * solution.value(s)).sum()
            } else {
                let q = |a: usize| -> f64 {
                    let terms = model.start().iter().zip(solution.q_of(a));
                    terms.map(|(b, q)| b * q).sum()
                };
                let actions = 0..model.actions().len();
                actions.map(q).fold(f64::NEG_INFINITY, f64::max)
            };
            answer.upper = Some(value + solution.error());
        }),
        Method::Fib => {
            fib::solve(model, budget).map(|fast| answer.upper = Some(fast.value(model.start())))
        }
        Method::Tib => fib::solve(model, budget).and_then(|fast| {
            // If it is stopped: what it begins with.
            answer.upper = Some(fast.value(model.start()));
            let tighter = tib::solve_from(model, &fast, budget)?;
            answer.upper = Some(tighter.value(model.start()));
            Ok(())
        }),
        Method::Sarsop => {
            let found = solve(model, options, budget, watch)?;
            let finite = |value: f64| value.is_finite().then_some(value);
            answer.lower = finite(found.bracket.lower);
            answer.upper = finite(found.bracket.upper);
            answer.progress = found.progress;
            answer.ended = found.ended;
            answer.vectors = found.vectors;
            Ok(())
        }
    };
    match found {
        Ok(()) => {}
        Err(SolveError::Stopped) => answer.ended = EndReason::Stopped,
        Err(error) => return Err(error),
    }
    Ok(answer)
}

fn blind_answer(model: &Pomdp, budget: &mut Budget<'_>) -> Result<Answer, SolveError> {
    let blind = blind::solve(model, budget)?;
    let rows = blind.rows().enumerate();
    Ok(Answer {
        vectors: AlphaVectors::new(model.states().len(), model.actions().len(), rows).ok(),
        ..Answer::new(Some(blind.value(model.start())), None)
    })
}
