//! Tests of the supervisor.

#![cfg(test)]

use vigil_cycle::allocation::CountingAllocator;

mod decisions;
mod exceptions;
mod hardware;
mod policies;
mod sight;
mod solved;
mod told;
mod world;

#[global_allocator]
static ALLOCATOR: CountingAllocator = CountingAllocator;
