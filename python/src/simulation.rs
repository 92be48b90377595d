//! What a policy earns in simulated missions.

use pyo3::prelude::*;
use vigil_missions::simulation::{Episode, Summary, World, horizon};
use vigil_pomdp::{Decider, Pomdp, Tracker};

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
/// same names. A run ends after `steps` (None: once the discount is below 1e-4, but after 1000000
/// at most). Equal seeds give equal random numbers, whichever the policy.
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
    let steps = steps.unwrap_or_else(|| horizon(world.discount(), STEPS_MAX));
    let mut end = End::after(None)?;
    let mut earned = py.detach(|| {
        policy.with_decider(|decider| {
            let mut mission = Mission {
                world,
                believed,
                decider,
                tracker: Tracker::new(believed),
                steps,
            };
            let numbers = 0..runs;
            let earned =
                numbers.map_while(|number| mission.run(Episode { seed, number }, &mut end));
            earned.collect::<Vec<f64>>()
        })
    });
    end.finish()?;
    let summary = Summary::new(&mut earned);
    Ok((summary.mean, summary.half_width))
}

/// A world, and who acts in it.
struct Mission<'a> {
    world: &'a Pomdp,
    believed: &'a Pomdp,
    decider: &'a mut Decider,
    tracker: Tracker,
    steps: usize,
}

impl Mission<'_> {
    /// The discounted reward of one run; none if the end has come.
    fn run(&mut self, episode: Episode, end: &mut End) -> Option<f64> {
        let mut world = World::new(self.world, episode);
        self.tracker.reset();
        self.decider.reset();
        let (mut sum, mut weight) = (0.0, 1.0);
        for _ in 0..self.steps {
            if end.has_come() {
                return None;
            }
            let action = self.decider.decide(self.tracker.belief()).action;
            let event = world.step(action);
            sum += weight * event.reward;
            weight *= self.world.discount();
            self.tracker
                .update(self.believed, action, event.observation);
        }
        Some(sum)
    }
}
