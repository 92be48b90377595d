//! Scores and their report.

#![cfg(test)]

mod report;
mod rover;
mod scoring;
mod trade_off;
