//! The sensor source at its ports.

mod actions;
mod peers;
mod playback;
mod simulator;
mod socket;

pub use playback::PlaybackSource;
pub use simulator::SimulatorSource;
pub use socket::{ListenAddresses, SocketStage};
