#![doc = include_str!("../README.md")]

pub mod bands;
pub mod chart;
pub mod colour;
mod markup;
pub mod page;
mod stroke;
pub mod svg;
pub mod trace;
