//! One mission.

use std::ops::ControlFlow;

use super::agent::Agent;
use super::stream::Episode;
use super::world::World;
use vigil_pomdp::Pomdp;
use vigil_pomdp::policy::Control;

/// What lies beyond the horizon weighs less than this.
const WEIGHT_MIN: f64 = 1e-4;

/// When a mission ends.
#[derive(Debug, Clone, PartialEq)]
pub struct Rules {
    /// Steps at most.
    pub steps_max: usize,
    /// For each action, whether the mission ends with it; its reward still counts.
    pub is_end: Vec<bool>,
}

impl Rules {
    /// No action ends it: it goes on until a goal is reached, the discount is below 1e-4, or for
    /// `cap` steps.
    #[must_use]
    pub fn endless(model: &Pomdp, cap: usize) -> Self {
        Self {
            steps_max: horizon(model.discount(), cap),
            is_end: vec![false; model.actions().len()],
        }
    }
}

/// What a mission brought.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Mission {
    /// sum_t gamma^t r_t.
    pub discounted: f64,
    /// sum_t r_t.
    pub undiscounted: f64,
    /// Steps taken.
    pub steps: usize,
    /// Steps taken to gather information.
    pub dual_steps: usize,
    /// Steps in which gathering information had stalled.
    pub stalled_steps: usize,
    /// Observations that were impossible in the agent's eyes.
    pub impossible: usize,
    /// True if an action or a goal ended it, and not the horizon.
    pub is_ended: bool,
}

/// The first step whose weight gamma^t is below 1e-4, but `cap` at most.
#[must_use]
pub fn horizon(discount: f64, cap: usize) -> usize {
    let steps = (WEIGHT_MIN.ln() / discount.ln()).ceil();
    if steps.is_finite() && steps >= 0.0 && steps < cap as f64 {
        (steps as usize).max(1)
    } else {
        cap
    }
}

/// One step of a mission, with the states that no agent sees.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct HiddenStep {
    /// The state in which the action was taken.
    pub before: usize,
    /// What the agent did.
    pub action: usize,
    /// The state that was reached.
    pub after: usize,
    /// What was observed there.
    pub observation: usize,
    /// The reward.
    pub reward: f64,
}

/// The mission of an agent in a world that follows `model`.
pub fn run(model: &Pomdp, agent: &mut dyn Agent, rules: &Rules, episode: Episode) -> Mission {
    run_watched(model, agent, rules, episode, &mut |_| {
        ControlFlow::Continue(())
    })
}

/// As [`run`]; `watch` is shown every step, and may break the mission off.
pub fn run_watched(
    model: &Pomdp,
    agent: &mut dyn Agent,
    rules: &Rules,
    episode: Episode,
    watch: &mut dyn FnMut(HiddenStep) -> ControlFlow<()>,
) -> Mission {
    let mut world = World::new(model, episode);
    let mut mission = Mission::default();
    let mut weight = 1.0;
    agent.begin();
    while mission.steps < rules.steps_max && !mission.is_ended {
        let act = agent.decide(world.chance());
        let before = world.state();
        let event = world.step(act.action);
        let goes_on = watch(HiddenStep {
            before,
            action: act.action,
            after: world.state(),
            observation: event.observation,
            reward: event.reward,
        });
        mission.discounted += weight * event.reward;
        mission.undiscounted += event.reward;
        weight *= model.discount();
        mission.steps += 1;
        mission.dual_steps += usize::from(act.control == Control::Dual);
        mission.stalled_steps += usize::from(act.control == Control::Stalled);
        let is_end = rules.is_end.get(act.action).copied().unwrap_or(false);
        mission.is_ended = is_end || model.is_goal(world.state());
        if goes_on.is_break() {
            break;
        }
        if !mission.is_ended {
            mission.impossible += usize::from(!agent.notice(act.action, event.observation));
        }
    }
    mission
}
