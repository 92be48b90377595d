//! Identifies the fault.
fn main() {}
