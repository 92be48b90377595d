//! The sensor source at its ports.

mod actions;
mod peers;
mod playback;
mod simulator;

pub use playback::PlaybackSource;
pub use simulator::SimulatorSource;
