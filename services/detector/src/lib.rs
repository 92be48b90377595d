//! Detects any deviation from nominal behaviour.
//!
//! [`Detector`] is a pure function of journal entries; [`wiring`] connects it to its ports.

mod assemble;
mod detector;
mod monitors;
mod pace;
mod publisher;
mod sight;
mod watch;
pub mod wiring;

pub use assemble::assemble;
pub use detector::{Detector, DetectorError};
pub use monitors::Monitors;
pub use sight::Sight;
pub use wiring::DetectorStage;
