//! What the supervisor does, and why, with names.

use schemars::JsonSchema;
use serde::Serialize;
use vigil_blocks::{Action, ControlMode, Weighing};
use vigil_setup::Setup;
use vigil_timeline::{NamedState, NamedWeighing};

/// States that are listed.
const STATES: usize = 3;

/// The present decision.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct Decision {
    /// The action, with the wheels that it is about.
    pub action: String,
    /// True once the robot must no longer obey it.
    pub has_expired: bool,
    /// How it was chosen: `policy`, `dual`, `fallback` or `safe`.
    pub chosen_by: &'static str,
    /// What the policy thinks of it, in the measure of `weighing`.
    pub value: f64,
    /// What the policy thinks of each action, in the same measure, the best first.
    pub actions: Vec<WeighedAction>,
    /// What it was weighed from; null if its numbers are not known.
    pub weighing: Option<NamedWeighing>,
    /// The most probable states of the decision model.
    pub states: Vec<NamedState>,
    /// Factor on the speed.
    pub speed_scale: f64,
    /// Decisions so far.
    pub decision_count: u64,
}

/// An action of the decision model.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct WeighedAction {
    /// Its name.
    pub action: String,
    /// What the policy thinks of it.
    pub value: f64,
}

impl Decision {
    /// A block with the names that the decision model gives.
    pub fn new(block: &Action, setup: &Setup, now_ns: u64) -> Self {
        let (states, actions) = (setup.decision.states(), setup.decision.actions());
        let at = block.action as usize;
        let action = actions.get(at).map_or("?", String::as_str);
        let weighing = Weighing::new(block);
        let named = states
            .iter()
            .zip(&block.belief)
            .map(|(name, p)| NamedState {
                name: name.clone(),
                p: *p,
            });
        let mut named: Vec<NamedState> = named.take(block.state_count as usize).collect();
        named.sort_by(|a, b| b.p.total_cmp(&a.p));
        named.truncate(STATES);
        let weighed = actions.iter().zip(&block.value);
        let weighed = weighed.map(|(action, value)| WeighedAction {
            action: action.clone(),
            value: *value,
        });
        let mut weighed: Vec<WeighedAction> = weighed.take(block.action_count as usize).collect();
        weighed.sort_by(|a, b| b.value.total_cmp(&a.value));
        Self {
            action: setup.robot.action_text(action, block.answered()),
            has_expired: block.valid_until_ns < now_ns,
            chosen_by: chosen_by(block.control_mode),
            value: block.value.get(at).copied().unwrap_or_default(),
            actions: weighed,
            weighing: weighing.map(|it| NamedWeighing::new(&it, states, actions)),
            states: named,
            speed_scale: block.speed_scale,
            decision_count: block.decision_seq,
        }
    }

    /// The action, and whether it holds, for people.
    pub fn action_text(&self) -> String {
        let chosen = match self.chosen_by {
            "policy" => String::new(),
            by => format!(" (by {})", by.to_uppercase()),
        };
        let expired = if self.has_expired { " EXPIRED" } else { "" };
        format!("{}{chosen}{expired}", self.action)
    }

    /// What the action is worth, and why the second best lost, for people.
    pub fn why(&self) -> String {
        let Some(weighing) = &self.weighing else {
            return String::new();
        };
        let value = self.value;
        let own = match weighing.measure.as_str() {
            "votes" => format!("has {value:.2} of the votes"),
            "entropy" => format!("leaves {:.3} of doubt", -value),
            _ => format!("worth {value:.2}"),
        };
        let second = weighing.second_text();
        second.map_or(own.clone(), |second| format!("{own}; {second}"))
    }

    /// The most probable states, for people.
    pub fn states_text(&self) -> String {
        let state = |state: &NamedState| format!("{} {:.3}", state.name, state.p);
        let states: Vec<String> = self.states.iter().map(state).collect();
        states.join("  ")
    }
}

const fn chosen_by(control_mode: u32) -> &'static str {
    const POLICY: u32 = ControlMode::Policy as u32;
    const DUAL: u32 = ControlMode::Dual as u32;
    const FALLBACK: u32 = ControlMode::Fallback as u32;
    const SAFE: u32 = ControlMode::Safe as u32;
    match control_mode {
        POLICY => "policy",
        DUAL => "dual",
        FALLBACK => "fallback",
        SAFE => "safe",
        _ => "?",
    }
}

#[cfg(test)]
mod tests {
    use super::super::Document;
    use crate::watch::sample::{self, NOW, setup};

    #[test]
    fn what_each_action_is_worth_is_listed_the_best_first() {
        let setup = setup();
        let document = Document::new(&sample::faulty(&setup), &setup, NOW);
        let actions = document.decision.unwrap().actions;
        let listed: Vec<_> = actions.iter().map(|it| (&*it.action, it.value)).collect();
        assert_eq!(listed[..2], [("compensate", 1.5), ("go_on", -3.0)]);
        assert_eq!(listed.len(), setup.decision.actions().len());
        assert!(listed[2..].iter().all(|(_, value)| *value == -90.0));
    }
}
