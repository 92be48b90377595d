//! What the black box costs the services: one graph, in which it runs, runs not, is stopped and is
//! killed by turns.
//!
//! One graph serves all of it, so that a comparison holds everything else fixed. Its launcher
//! starts no black box: this program does, with the launcher's words, and restarts a killed one
//! after the launcher's delay. Latencies come from the services' own stamps; nothing else observes.

mod drive;
mod half;
mod process;
mod report;

pub use drive::{Plan, Run};
pub use half::{Half, State};
pub use report::{document, table};
