//! Tests of the robot's models.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, missing_docs)]

mod condition;
mod encoder_noise;
mod frame_guard;
mod gaps;
mod injection;
mod learned;
mod noise;
mod nominal;
mod rover;
mod slip;
mod stuck_sets;
mod torque_limit;
