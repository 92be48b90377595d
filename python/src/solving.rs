//! What takes long: bounds, policies, and their values. Python goes on meanwhile.

use pyo3::prelude::*;
use vigil_pomdp::policy::{Dual, PolicyName};
use vigil_pomdp::solver::{self, Method, Options};
use vigil_pomdp::{Budget, Choice, Decider, mdp};

use crate::errors::refusal;
use crate::model::Model;
use crate::policy::{Policy, Solved};
use crate::signals::End;

const BYTES_PER_GIB: f64 = (1_u64 << 30) as f64;

/// Processor time of this thread, s.
fn thread_s(py: Python<'_>) -> PyResult<f64> {
    py.import("time")?.call_method0("thread_time")?.extract()
}

fn check(name: &str, value: f64) -> PyResult<()> {
    if value.is_finite() && value >= 0.0 {
        return Ok(());
    }
    Err(refusal(format!(
        "{name} is {value}, allowed is a number from 0"
    )))
}

/// Finds the best policy, and bounds of what any policy earns, by a point-based search.
///
/// It ends when the bounds are within `precision` of each other (in units of the reward), after
/// `timeout_s` seconds (None: never), or when its tables fill `memory_gib` GiB. The same model and
/// precision give the same policy, unless time or memory ended the search.
///
/// Raises PomdpError for a model of unbounded value, such as one with discount 1 and no goal, and
/// if time ended before there was a policy; KeyboardInterrupt on Ctrl-C.
#[pyfunction]
#[pyo3(signature = (model, *, precision=1e-3, timeout_s=60.0, memory_gib=3.0))]
pub fn solve(
    py: Python<'_>,
    model: Model,
    precision: f64,
    timeout_s: Option<f64>,
    memory_gib: f64,
) -> PyResult<Policy> {
    check("precision", precision)?;
    check("memory_gib", memory_gib)?;
    let options = Options {
        precision,
        memory_bytes_max: (memory_gib * BYTES_PER_GIB) as usize,
    };
    let mut end = End::after(timeout_s)?;
    let start_s = thread_s(py)?;
    let found = py.detach(|| {
        let mut stop = || end.has_come();
        let mut watch = |_: &solver::Progress| ();
        solver::solve(
            &model.pomdp,
            &options,
            &mut Budget::new(&mut stop),
            &mut watch,
        )
    });
    end.finish()?;
    let found = found.map_err(refusal)?;
    let early = || refusal("ended before there was a policy; give it more time by timeout_s");
    let finite = |value: f64| value.is_finite().then_some(value);
    let solved = Solved {
        vectors: found.vectors.ok_or_else(early)?,
        method: Method::Sarsop.to_string(),
        lower: finite(found.bracket.lower),
        upper: finite(found.bracket.upper),
        cpu_s: (thread_s(py)? - start_s).max(0.0),
    };
    py.detach(|| Policy::solved(model, solved))
}

/// Bounds the best value at the start belief: (lower, upper), None where the method gives none.
///
/// `mdp` (the state is known), `qmdp` (known after one step), `fib` (fast informed bound) and `tib`
/// (tighter informed bound) are upper bounds, `blind` (one action for ever) is a lower one.
/// `sarsop` gives both; `solve` gives its policy, too.
///
/// Raises PomdpError; KeyboardInterrupt on Ctrl-C.
#[pyfunction]
#[pyo3(signature = (model, method, *, timeout_s=60.0))]
pub fn bound(
    py: Python<'_>,
    model: Model,
    method: &str,
    timeout_s: Option<f64>,
) -> PyResult<(Option<f64>, Option<f64>)> {
    let method: Method = method.parse().map_err(refusal)?;
    let mut end = End::after(timeout_s)?;
    let answer = py.detach(|| {
        let mut stop = || end.has_come();
        let mut watch = |_: &solver::Progress| ();
        let options = Options::default();
        let budget = &mut Budget::new(&mut stop);
        solver::bound(method, &model.pomdp, &options, budget, &mut watch)
    });
    end.finish()?;
    let answer = answer.map_err(refusal)?;
    Ok((answer.lower, answer.upper))
}

/// A policy that follows from the model without a search: `mls` (most likely state), `av` (action
/// voting), `qmdp`, `fib` (fast informed bound), and `dm-X` and `adm-X` of each.
///
/// dm-X and adm-X act by X while the normalised entropy of the state or of the action is at most
/// `threshold`, 0 to 1, and gather information above it.
///
/// Raises PomdpError.
#[pyfunction]
#[pyo3(signature = (model, name, *, threshold=0.5))]
pub fn heuristic(py: Python<'_>, model: Model, name: &str, threshold: f64) -> PyResult<Policy> {
    let kind: PolicyName = name.parse().map_err(refusal)?;
    py.detach(|| {
        let relaxed = mdp::solve(&model.pomdp).map_err(refusal)?;
        let settings = |information| Dual::new(information, threshold);
        let decider = kind.build(&model.pomdp, &relaxed, settings);
        let decider = decider.map_err(refusal)?;
        let has_memory = kind.information.is_some();
        Ok(Policy::heuristic(
            model,
            kind.to_string(),
            has_memory,
            decider,
        ))
    })
}

/// A policy of at most `vectors_max` of a solved one's vectors: those that lose least.
///
/// What they lose is sampled and taken from `lower`: the mean and four standard errors.
///
/// Raises PomdpError for a heuristic; KeyboardInterrupt on Ctrl-C.
#[pyfunction]
pub fn compact(py: Python<'_>, policy: &Bound<'_, Policy>, vectors_max: usize) -> PyResult<Policy> {
    let policy = policy.get();
    let solved = policy.solved_or_refusal()?;
    if vectors_max == 0 {
        return Err(refusal("vectors_max is 0, allowed is a number from 1"));
    }
    let mut end = End::after(None)?;
    let small = py.detach(|| {
        let mut stop = || end.has_come();
        let budget = &mut Budget::new(&mut stop);
        solver::compact(&policy.model.pomdp, &solved.vectors, vectors_max, budget)
    });
    end.finish()?;
    let small = small.map_err(refusal)?;
    let loss = small.loss_max();
    let solved = Solved {
        vectors: small.vectors,
        lower: solved.lower.map(|lower| lower - loss),
        ..solved.clone()
    };
    py.detach(|| Policy::solved(policy.model.clone(), solved))
}

/// A decider as the policy that it decides by.
struct Rule<'a>(&'a mut Decider);

impl vigil_pomdp::Policy for Rule<'_> {
    fn evaluate(&mut self, belief: &[f64], values: &mut [f64]) -> Choice {
        let choice = self.0.decide(belief).choice();
        values.copy_from_slice(self.0.values());
        choice
    }
}

/// Bounds, that hold for certain, of what a policy earns from the start belief: (lower, upper).
///
/// The beliefs that it reaches are gone through, the most probable first, `beliefs_max` at most.
///
/// Raises PomdpError for dual control, which remembers; KeyboardInterrupt on Ctrl-C.
#[pyfunction]
#[pyo3(signature = (policy, *, beliefs_max=20_000))]
pub fn value(
    py: Python<'_>,
    policy: &Bound<'_, Policy>,
    beliefs_max: usize,
) -> PyResult<(f64, f64)> {
    let policy = policy.get();
    if policy.has_memory {
        return Err(refusal(format!(
            "{} remembers earlier decisions, allowed are policies that remember nothing; simulate \
             it",
            policy.name
        )));
    }
    let mut end = End::after(None)?;
    let found = py.detach(|| {
        let mut stop = || end.has_come();
        let budget = &mut Budget::new(&mut stop);
        policy.with_decider(|decider| {
            let model = &policy.model.pomdp;
            solver::policy_value(model, &mut Rule(decider), beliefs_max, budget)
        })
    });
    end.finish()?;
    let found = found.map_err(refusal)?;
    Ok((found.lower, found.upper))
}
