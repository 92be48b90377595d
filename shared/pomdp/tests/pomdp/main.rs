//! Tests of the library of decision models.

#![cfg(test)]

mod belief;
mod bounds;
mod despot;
mod dual;
mod examples;
mod goals;
mod grammar;
mod hostile;
mod inspection;
mod point_based;
mod policy_file;
mod policy_graph;
mod pomdpx;
mod process;
mod public;
mod reference;
mod round_trip;
mod simulation;
mod solver;
mod solver_shapes;
