//! The commands, one a module: each has its `Args` and a `run`.

pub mod diagnose;
pub mod evaluate;
pub mod import;
pub mod learn;
mod learn_nominal;
mod offline;
pub mod pomdp;
