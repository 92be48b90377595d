//! Does the diagnosis hold in the field? Long runs, gaps, other grounds, lags and noise, faults
//! that come, go and come again: scenarios of `bench/field.toml`, scored at every instant.
//!
//! Detector, identifier and supervisor run in one process over the simulator's world. The world is
//! driven with every set of sensors at once; what is decided is scored, but obeyed only where a
//! scenario says so. Recorded runs are played to the same stages.

mod bar;
mod course;
mod delays;
mod fault;
mod frames;
mod ground;
mod healthy;
mod job;
mod passage;
mod recorded;
mod report;
mod run;
mod scenario;
mod timeline;
mod watch;

pub use bar::{Bar, Comparison};
pub use delays::{Detected, MISSED_S, detect};
pub use healthy::record;
pub use job::{Job, ScoredRun};
pub use recorded::{Library, Material, library};
pub use report::{Outcome, barred_lines, document, lines, told_timelines};
pub use run::{Graph, jobs, run, select};
pub use scenario::{Departure, Draw, File, Frames, Scenario, Source, World};
