//! Tests of recordings.

#![cfg(test)]

mod live;
mod reader;
mod written;
