//! Learning from recorded runs: what is found, what is refused.

#![cfg(test)]

mod channel_learning;
mod channel_sensing;
mod commanded_faults;
mod contexts;
mod declared_faults;
mod isolability;
mod learning;
mod refusals;
mod rover;
mod several_faults;
mod small;
mod turning_faults;
mod wandering;
