//! Decisions under uncertainty: POMDP models, their solution, policies, belief tracking.
//!
//! A [`Pomdp`] is read from Cassandra's `.pomdp` format or APPL's `.pomdpx`, and written as
//! `.pomdp`; [`bounds`] and [`solver`] say what it is worth at best, and find plans; a [`Policy`]
//! turns a belief into an action; a [`Tracker`] keeps the belief.
//! Deciding and tracking allocate nothing. No transport, no clock, no files.
//!
//! Notation of Verma, Fernandez and Simmons (2002): states S, actions A, observations Z,
//! T(s,a,s') = p(s'|s,a), Z(a,s',z) = p(z|a,s'), R(s,a), discount gamma.

pub mod alpha_vectors;
pub mod belief;
pub mod bounds;
pub mod budget;
mod fnv1a;
pub mod model;
pub mod policy;
pub mod policy_file;
pub mod policy_graph;
#[cfg(feature = "xml")]
mod pomdpx;
mod reader;
pub mod solver;
mod sparse_beliefs;
mod weights;
mod writer;

pub use alpha_vectors::AlphaVectors;
pub use belief::{Evidence, Tracker};
pub use bounds::mdp;
pub use budget::Budget;
pub use model::{Pomdp, Warning};
pub use policy::{
    ActionVoting, Choice, Control, Decider, MostLikelyState, PointBased, Policy, QMdp,
};
pub use reader::{ParseError, Position};
