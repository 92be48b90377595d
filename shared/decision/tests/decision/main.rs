//! Tests of the supervisor.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, missing_docs)]

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
