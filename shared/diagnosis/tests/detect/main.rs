//! Tests of the detector.

#![cfg(test)]

use vigil_cycle::allocation::CountingAllocator;

mod allocation;
mod channels;
mod detector;
mod forms;
mod meaning;
mod monitors;
mod recorded;

#[global_allocator]
static ALLOCATOR: CountingAllocator = CountingAllocator;
