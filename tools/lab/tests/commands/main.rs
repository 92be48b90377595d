//! Tests of the commands, each a process of its own.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, missing_docs)]

mod model;
mod nominal;
mod offline;
mod pomdp;
mod pomdp_compare;
mod pomdp_learn;
mod pomdp_solve;
mod report;
mod your_robot;
