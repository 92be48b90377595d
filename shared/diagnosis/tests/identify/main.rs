//! Tests of the identifier.

#![cfg(test)]

use vigil_cycle::allocation::CountingAllocator;

mod alarm;
mod all_sets;
mod allocation;
mod an_hour;
mod driven;
mod further;
mod hypotheses;
mod identifier;
mod recorded;
mod servo;
mod sizes;

#[global_allocator]
static ALLOCATOR: CountingAllocator = CountingAllocator;
