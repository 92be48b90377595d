//! Tests of the graph file.

#![cfg(test)]

mod alarm;
mod document;
mod geometry;
mod navigation;
mod published;
mod shipped;
