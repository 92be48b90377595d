//! Tests of both steps.

#![cfg(test)]

use vigil_cycle::allocation::CountingAllocator;

mod detect;
mod hostile;
mod identify;
mod recorded;

#[global_allocator]
static ALLOCATOR: CountingAllocator = CountingAllocator;
