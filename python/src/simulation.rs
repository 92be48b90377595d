//! What a policy earns in simulated missions.

use std::ops::ControlFlow;

use pyo3::prelude::*;
use vigil_missions::simulation::{Episode, PolicyAgent, Rules, Summary, run_watched};
use vigil_pomdp::Pomdp;

use crate::errors::refusal;
use crate::model::Model;
use crate::policy::Policy;
use crate::signals::End;

/// Steps of a mission, at most, if nothing else is said.
const STEPS_MAX: usize = 1_000_000;

/// What a policy earns in a simulated world: the mean discounted reward of a run, and the half
/// width of its 95 % interval.
///
/// The world follows `model`; the policy believes in its own, which may be another one with the
/// same names. A run ends at a goal, or after `steps` (None: once the discount is below 1e-4, but
/// after 1000000 at most). Equal seeds give equal random numbers, whichever the policy.
///
/// Raises PomdpError; KeyboardInterrupt on Ctrl-C.
#[pyfunction]
#[pyo3(signature = (model, policy, *, runs=1000, steps=None, seed=1))]
pub fn simulate(
    py: Python<'_>,
    model: Model,
    policy: &Bound<'_, Policy>,
    runs: u64,
    steps: Option<usize>,
    seed: u64,
) -> PyResult<(f64, f64)> {
    let policy = policy.get();
    let (world, believed) = (&*model.pomdp, &*policy.model.pomdp);
    let names =
        |model: &Pomdp| [model.states(), model.actions(), model.observations()].map(<[_]>::to_vec);
    if names(world) != names(believed) {
        return Err(refusal(
            "the names of the model and of the policy's differ; allowed are the same names in the \
             same order",
        ));
    }
    if runs < 2 {
        return Err(refusal(format!(
            "runs is {runs}, allowed is a number from 2"
        )));
    }
    let mut rules = Rules::endless(world, STEPS_MAX);
    rules.steps_max = steps.unwrap_or(rules.steps_max);
    let mut end = End::after(None)?;
    let mut earned = py.detach(|| {
        policy.with_decider(|decider| {
            let mut agent = PolicyAgent::new(believed, decider);
            let mut earn = |number| {
                let mut has_ended = false;
                let episode = Episode { seed, number };
                let mission = run_watched(world, &mut agent, &rules, episode, &mut |_| {
                    has_ended = end.has_come();
                    match has_ended {
                        true => ControlFlow::Break(()),
                        false => ControlFlow::Continue(()),
                    }
                });
                (!has_ended).then_some(mission.discounted)
            };
            (0..runs).map_while(&mut earn).collect::<Vec<f64>>()
        })
    });
    end.finish()?;
    let summary = Summary::new(&mut earned);
    Ok((summary.mean, summary.half_width))
}
