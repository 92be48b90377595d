#![doc = include_str!("../README.md")]

mod belief;
mod events;
mod gaps;
mod health;
mod latency;
mod lives;
mod measured;
mod path;
mod recording;
mod spans;
mod verdict;

pub use recording::page;
