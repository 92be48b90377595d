//! Tests of the library of decision models.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, missing_docs)]

mod belief;
mod bounds;
mod dual;
mod grammar;
mod heuristics;
mod hostile;
mod learning;
mod learning_intervals;
mod learning_navigation;
mod learning_online;
mod navigation;
mod point_based;
mod policy_file;
mod policy_graph;
mod pomdpx;
mod public;
mod recorded;
mod reference;
mod round_trip;
mod simulation;
mod solver;
mod solver_shapes;
