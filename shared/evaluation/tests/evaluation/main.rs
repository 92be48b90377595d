//! Tests of the evaluation: readers, learners, scores, report.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, missing_docs)]

mod import;
mod learning;
mod learning_nominal;
mod nominal_sensing;
mod reader;
mod refusals;
mod report;
mod rover;
mod scoring;
mod trade_off;
