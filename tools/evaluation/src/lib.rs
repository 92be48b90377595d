//! Scores of a diagnosis on labelled runs, and their report. Reads no file itself.

pub mod report;
pub mod scoring;
