//! A robot that follows a planned path in a corridor and executes the supervisor's actions.
//!
//! The navigator knows its pose only as measured. The range sensor, walls, obstacles and people
//! belong to the simulated world. The navigator gives the rover commands only, so that slip, faults
//! and noise act on it as on any drive.

mod behaviour;
mod condition;
mod faults;
mod lane;
mod map;
mod navigator;
mod path;
mod task;

pub use condition::{NavigationCondition, WayAhead};
pub use navigator::{ActionRequest, DecisionId, Help, Navigator, NavigatorEvent};
