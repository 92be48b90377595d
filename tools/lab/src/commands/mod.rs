//! The commands, one a module: each has its `Args` and a `run`.

mod cross_validation;
pub mod diagnose;
pub mod evaluate;
mod files;
pub mod frames;
pub mod import;
pub mod init;
mod labelled_runs;
pub mod learn;
pub mod learn_channels;
mod learn_task;
pub mod mend;
mod offline;
pub mod pomdp;
pub mod replay;
pub mod report;
pub mod schema;
