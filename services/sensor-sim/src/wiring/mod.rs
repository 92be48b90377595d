//! The sensor source at its ports.

mod actions;
mod answers;
mod newest;
mod peers;
mod playback;
mod simulator;
mod socket;

pub use answers::VerdictNames;
pub use playback::PlaybackSource;
pub use simulator::SimulatorSource;
pub use socket::{ListenAddresses, SocketInputs, SocketStage};
