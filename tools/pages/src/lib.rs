#![doc = include_str!("../README.md")]

pub mod bands;
pub mod chart;
pub mod colour;
pub mod page;
pub mod svg;
pub mod trace;
