//! Bayes filters over hybrid models: detection of any deviation from nominal, identification of
//! the fault. No robot, no transport, no clock, no files.

pub mod tree;

pub use tree::FaultTree;
