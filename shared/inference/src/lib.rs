//! Bayes filters over hybrid models: detection of any deviation from nominal, identification of
//! the fault. No robot, no transport, no clock, no files.
//!
//! | module | holds |
//! |---|---|
//! | [`logspace`] | sums and odds of probabilities kept as logarithms |
//! | [`resample`] | systematic resampling |
//! | [`particles`] | planar pose particles, structure of arrays |
//! | [`gaussian`] | the Kalman filter |
//! | [`track`] | a pose track with run offsets and coloured deviations |
//! | [`lanes`] | planar robots with tables per mode: the fast particle filter |
//! | [`forward`] | the exact forward filter of a small hidden Markov model |
//! | [`ages`] | detection: nominal against nominal plus an unknown constant bias |
//! | [`constant`] | detection: nominal against a constant likelihood |
//! | [`bank`] | exact single faults: one hypothesis per (mode, onset) |
//! | [`tree`] | the fault tree |

pub mod adaptive;
pub mod ages;
pub mod angle;
pub mod bank;
pub mod bootstrap;
pub mod constant;
pub mod fault_sets;
pub mod filter;
pub mod forward;
pub mod gaussian;
pub mod hierarchical;
pub mod hybrid;
pub mod lanes;
pub mod logspace;
pub mod look_ahead;
pub mod merged;
pub mod particles;
pub mod proposal;
pub mod resample;
pub mod risk;
pub mod sequences;
pub mod track;
pub mod tree;
pub mod weights;

pub use tree::FaultTree;
