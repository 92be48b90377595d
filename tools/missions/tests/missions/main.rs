//! Simulated missions, and what is learned from recorded ones.

#![cfg(test)]

mod exceptions;
mod heuristics;
mod learning;
mod learning_check;
mod learning_intervals;
mod learning_navigation;
mod navigation;
mod public;
mod recorded;
mod recovery;
mod simulation;
