//! Decides what to do about a fault.
fn main() {}
