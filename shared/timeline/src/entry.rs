//! An event in words.

use std::fmt;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::wall_clock::time_of_day;
use crate::weighing::NamedWeighing;

/// An event in words.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct TimelineEntry {
    /// Seconds since every service answered for the first time; `None` while they have not.
    pub t_s: Option<f64>,
    /// When, `CLOCK_MONOTONIC` ns.
    pub t_ns: u64,
    /// When by the calendar: RFC 3339, UTC, to the millisecond.
    pub wall: String,
    /// The service that says so; of `restarted` the one that was.
    pub service: String,
    /// Kind of the event.
    pub event: String,
    /// What it is about.
    pub what: String,
    /// Probability, where the event has one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub p: Option<f64>,
    /// How many cycles were missed, or frames refused.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub count: Option<u64>,
    /// Of a diagnosis of several faults: the most probable set, joined by `+`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub fault_set: Option<String>,
    /// Of what a decision was weighed from.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub weighing: Option<NamedWeighing>,
    /// Of a step of the decision model.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub step: Option<NamedStep>,
    /// Of a change in the life of a fault.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub fault: Option<NamedFault>,
}

/// A fault that has another state, with its names.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct NamedFault {
    /// Counts the graph's faults, from 1.
    pub number: u64,
    /// Its name.
    pub name: String,
    /// Its state.
    pub state: String,
}

impl fmt::Display for NamedFault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} is {}", self.name, self.state)
    }
}

/// A step of the decision model, with its names.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct NamedStep {
    /// From 1, since the supervisor started.
    pub number: u64,
    /// Steps of one belief have one number: it began anew between others.
    pub belief: u32,
    /// The action.
    pub action: String,
    /// What was observed after it; `None` for what the model does not have.
    pub observation: Option<String>,
}

impl fmt::Display for NamedStep {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let observation = self.observation.as_deref();
        write!(f, "{} {}", self.action, observation.unwrap_or("?"))
    }
}

impl TimelineEntry {
    /// False for what only programs read: each step of the decision model.
    #[must_use]
    pub const fn is_told(&self) -> bool {
        self.step.is_none()
    }

    /// The line for people, the time of day before it.
    #[must_use]
    pub fn line(&self) -> String {
        format!("{}  {self}", time_of_day(&self.wall))
    }
}

impl fmt::Display for TimelineEntry {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self {
            service,
            event,
            what,
            ..
        } = self;
        let since = self.t_s.map_or("-".to_owned(), |t_s| format!("{t_s:.3}"));
        write!(f, "{since:>9} s  {service:<10}  {event:<10}  {what}")?;
        if let Some(set) = &self.fault_set {
            write!(f, " {set}")?;
        }
        self.p.map_or(Ok(()), |p| write!(f, "  p={p:.3}"))
    }
}
