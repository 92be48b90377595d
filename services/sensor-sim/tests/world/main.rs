//! The simulated rover as its users see it.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

mod corridor;
mod disturbances;
mod faults;
mod hostile;
mod motion;
mod rover;
mod sensors;
