//! Detects any deviation from nominal behaviour: [`Detector`].

mod detector;
mod monitors;
mod pace;
mod publisher;
mod sight;
mod watch;

pub use detector::{Detector, DetectorError};
pub use monitors::Monitors;
pub use sight::Sight;
