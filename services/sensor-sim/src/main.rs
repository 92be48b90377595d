//! The simulated rover, and playback of recorded frames.
fn main() {}
