//! Tests of the robot's models.

#![cfg(test)]

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
