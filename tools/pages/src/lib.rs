#![doc = include_str!("../README.md")]

pub mod chart;
pub mod page;
pub mod svg;
