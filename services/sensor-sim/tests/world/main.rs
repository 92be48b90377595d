//! The simulated rover as its users see it.

#![cfg(test)]

mod corridor;
mod disturbances;
mod faults;
mod hostile;
mod motion;
mod rover;
mod sensors;
mod socket;
