//! Learning from recorded runs: what is found, what is refused.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

mod learning;
mod learning_nominal;
mod nominal_sensing;
mod refusals;
mod rover;
