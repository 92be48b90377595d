//! Scores and their report.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

mod report;
mod rover;
mod scoring;
mod trade_off;
