//! Detects any deviation from nominal behaviour.
fn main() {}
