//! Tests of the robot's models.

#![cfg(test)]

mod action_text;
mod channel_law;
mod channel_model;
mod condition;
mod contexts;
mod declared_faults;
mod encoder_noise;
mod frame_guard;
mod gaps;
mod injection;
mod learned;
mod noise;
mod publisher_check;
mod rover;
mod slip;
mod stuck_sets;
mod torque_limit;
