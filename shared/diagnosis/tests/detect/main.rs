//! Tests of the detector.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, missing_docs)]

use vigil_cycle::allocation::CountingAllocator;

mod allocation;
mod detector;
mod forms;
mod meaning;
mod monitors;
mod nominal;
mod recorded;

#[global_allocator]
static ALLOCATOR: CountingAllocator = CountingAllocator;
