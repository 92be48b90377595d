//! A robot that follows a planned path in a corridor, and does what the supervisor asks of it.
//!
//! The navigator knows its pose only as measured; the range sensor and the walls, obstacles and
//! people that it meets are the world's. It turns an order into a command for the rover, so that
//! slip, faults and noise stay what they are.

mod behaviour;
mod lane;
mod map;
mod navigator;
mod path;
mod task;
mod troubles;

pub use navigator::{Navigator, NavigatorEvent, Order};
