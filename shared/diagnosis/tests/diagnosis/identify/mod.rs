//! Tests of the identifier.

mod alarm;
mod all_sets;
mod allocation;
mod an_hour;
mod driven;
mod further;
mod hypotheses;
mod identifier;
mod servo;
mod sizes;
