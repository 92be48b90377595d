//! Decisions under uncertainty: POMDP models, their solution, policies, belief tracking.
//!
//! A [`Pomdp`] is read from Cassandra's `.pomdp` format or APPL's `.pomdpx`, and written as
//! `.pomdp`; its fully observable relaxation is solved by [`mdp::solve`]; a [`Policy`] turns a
//! belief into an action; a [`Tracker`] keeps the belief.
//! Deciding and tracking allocate nothing. No transport, no clock, no files.
//!
//! Notation of Verma, Fernandez and Simmons (2002): states S, actions A, observations Z,
//! T(s,a,s') = p(s'|s,a), Z(a,s',z) = p(z|a,s'), R(s,a), discount gamma.

pub mod belief;
pub mod learning;
pub mod mdp;
pub mod model;
pub mod navigation;
pub mod policy;
mod pomdpx;
mod reader;
pub mod simulation;
mod weights;
mod writer;

pub use belief::{Evidence, Tracker};
pub use model::{Pomdp, Warning};
pub use policy::{ActionVoting, Choice, Control, Decider, MostLikelyState, Policy, QMdp};
pub use reader::{ParseError, Position};
