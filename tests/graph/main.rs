//! The real processes over real shared memory. Each test runs a graph of its own name; one after
//! the other, since they share the machine's cores.

#![cfg(test)]

mod assertion;
mod bad_input;
#[path = "../built/mod.rs"]
mod built;
mod corridor;
mod external;
mod faults;
mod front_door;
mod harness;
mod identity;
mod injection;
mod killing;
mod measured;
mod playback;
mod realtime;
mod recount;
mod truth;
