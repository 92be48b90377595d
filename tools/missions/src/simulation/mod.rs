//! Missions through an event simulator: what a policy is worth on a model.
//!
//! [`World`] draws start, next state and observation from a decision model; an [`Agent`] acts:
//! a policy with its belief, a deterministic [`Escalation`], or [`Random`]; [`run`] brings the two
//! together for one mission. Random numbers are *paired*: step k of episode e takes the same
//! numbers whoever acts, so that differences between agents ([`PairedDifference`]) are known far
//! better than their means ([`Summary`]).
//!
//! The world may follow another model than the one that the agent believes in, as long as names
//! agree: that shows what an error in the model costs.

mod agent;
mod escalation;
mod mission;
mod statistics;
mod stream;
mod world;

pub use agent::{Act, Agent, PolicyAgent, Random};
pub use escalation::{Escalation, EscalationError};
pub use mission::{HiddenStep, Mission, Rules, horizon, run, run_watched};
pub use statistics::{PairedDifference, Summary};
pub use stream::{Episode, Stream};
pub use world::{Event, World};
