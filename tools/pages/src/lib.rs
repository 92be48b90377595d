#![doc = include_str!("../README.md")]

pub mod bands;
pub mod chart;
pub mod colour;
pub mod columns;
pub mod heat;
mod markup;
pub mod page;
pub mod spectrum;
mod stroke;
pub mod svg;
pub mod trace;
