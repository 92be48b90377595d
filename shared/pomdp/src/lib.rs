#![cfg_attr(feature = "solver", doc = include_str!("../README.md"))]
#![cfg_attr(
    not(feature = "solver"),
    doc = "Models, belief tracking and policies of partially observable Markov decision processes."
)]

pub mod alpha_vectors;
pub mod belief;
pub mod bounds;
pub mod budget;
mod fnv1a;
pub mod model;
mod parse_error;
pub mod policy;
pub mod policy_file;
#[cfg(feature = "solver")]
pub mod policy_graph;
#[cfg(feature = "pomdpx")]
mod pomdpx;
pub mod process;
mod reader;
#[cfg(feature = "solver")]
pub mod solver;
#[cfg(feature = "solver")]
mod sparse_beliefs;
mod weights;
#[cfg(feature = "solver")]
mod writer;

pub use alpha_vectors::AlphaVectors;
pub use belief::{Evidence, Tracker};
pub use bounds::mdp;
pub use budget::Budget;
pub use model::{Pomdp, Warning};
pub use parse_error::{ParseError, Position};
pub use policy::{
    ActionVoting, Choice, Control, Decider, Despot, MostLikelyState, PointBased, Policy, QMdp,
};
pub use process::{Process, ProcessError};
