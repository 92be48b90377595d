//! Tests of the supervisor.

#![cfg(test)]

use vigil_cycle::allocation::CountingAllocator;

mod changes;
mod decisions;
mod exceptions;
mod hardware;
mod limping;
mod navigation;
mod planning;
mod policies;
mod sight;
mod solved;
mod world;

#[global_allocator]
static ALLOCATOR: CountingAllocator = CountingAllocator;
