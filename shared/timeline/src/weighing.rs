//! What a decision was weighed from, in words.

use std::fmt;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use vigil_blocks::{ValueKind, Weighing};

/// What a decision was weighed from, with the names of the decision model.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct NamedWeighing {
    /// The most probable states, at most two.
    pub states: Vec<NamedState>,
    /// The best of the other actions.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub second: Option<NamedSecond>,
    /// What the actions' numbers are: `value` (rewards to come), `votes` or `entropy`.
    pub measure: String,
}

/// A state of the decision model.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct NamedState {
    /// Its name.
    pub name: String,
    /// Its probability.
    pub p: f64,
}

/// An action that was not taken.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct NamedSecond {
    /// Its name.
    pub action: String,
    /// How much less its number is than that of the action taken.
    pub less: f64,
}

impl NamedWeighing {
    /// Names the states and actions of a weighing.
    #[must_use]
    pub fn new(weighing: &Weighing, states: &[String], actions: &[String]) -> Self {
        let name =
            |names: &[String], at: usize| names.get(at).map_or("?", String::as_str).to_owned();
        let state = |(at, p): (usize, f32)| NamedState {
            name: name(states, at),
            p: f64::from(p),
        };
        Self {
            states: weighing.states.into_iter().flatten().map(state).collect(),
            second: weighing.second.map(|(at, less)| NamedSecond {
                action: name(actions, at),
                less: f64::from(less),
            }),
            measure: match weighing.measure {
                ValueKind::Value => "value",
                ValueKind::Votes => "votes",
                ValueKind::Entropy => "entropy",
            }
            .to_owned(),
        }
    }

    /// Why the second best action was not taken; `None` if there is no other.
    #[must_use]
    pub fn second_text(&self) -> Option<String> {
        let NamedSecond { action, less } = self.second.as_ref()?;
        let (size, is_less) = (less.abs(), *less >= 0.0);
        let word = if is_less { "less" } else { "more" };
        Some(match self.measure.as_str() {
            "votes" => format!("{action} has {size:.2} {word} of the votes"),
            "entropy" => format!("{action} would tell {size:.3} {word}"),
            _ => format!("{action} is worth {size:.2} {word}"),
        })
    }
}

impl fmt::Display for NamedWeighing {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let state = |state: &NamedState| format!("{} {:.3}", state.name, state.p);
        let states: Vec<String> = self.states.iter().map(state).collect();
        write!(f, "{}", states.join(", "))?;
        self.second_text()
            .map_or(Ok(()), |second| write!(f, "; {second}"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_decision_is_told_with_its_states_and_what_came_second() {
        let names = |names: [&str; 2]| names.map(str::to_owned);
        let (states, actions) = (names(["ND", "STUCK"]), names(["go_on", "compensate"]));
        let text =
            |weighing: Weighing| NamedWeighing::new(&weighing, &states, &actions).to_string();
        let named = Weighing {
            states: [Some((1, 0.875)), Some((0, 0.125))],
            second: Some((0, 4.5)),
            measure: ValueKind::Value,
        };
        assert_eq!(
            text(named),
            "STUCK 0.875, ND 0.125; go_on is worth 4.50 less"
        );
        let stands = Weighing {
            second: Some((0, -0.25)),
            ..named
        };
        assert!(text(stands).ends_with("; go_on is worth 0.25 more"));
        let votes = Weighing {
            states: [Some((1, 1.0)), None],
            measure: ValueKind::Votes,
            ..named
        };
        assert_eq!(text(votes), "STUCK 1.000; go_on has 4.50 less of the votes");
        let foreign = Weighing {
            states: [Some((7, 1.0)), None],
            second: None,
            measure: ValueKind::Entropy,
        };
        assert_eq!(text(foreign), "? 1.000");
    }
}
