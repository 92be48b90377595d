//! Learning from recorded runs: what is found, what is refused.

#![cfg(test)]

mod learning;
mod learning_nominal;
mod nominal_sensing;
mod refusals;
mod rover;
