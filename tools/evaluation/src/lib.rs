#![doc = include_str!("../README.md")]

pub mod parallel;
pub mod report;
pub mod scoring;
pub mod stages;
