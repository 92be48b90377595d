//! Tests of the import.

#![cfg(test)]

mod bags;
mod logs;
mod suggest;
mod sums;
