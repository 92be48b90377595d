#![doc = include_str!("../README.md")]

mod cargo;
mod configured;
mod measure;
mod rust;
mod source;

pub use cargo::{LinkedCrate, linked_crates};
pub use measure::{Distribution, Lines, Size, measure};
pub use rust::{Function, Import, Parameter, Rust, Text, TypeName};
pub use source::{Source, root, workspace};
