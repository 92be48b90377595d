//! Detects any deviation from nominal behaviour: [`Detector`].

mod detector;
mod monitors;
mod pace;
mod publisher;
mod settings;
mod sight;
mod watch;

pub use detector::{Detector, DetectorError};
pub use monitors::Monitors;
pub use settings::{Form, MonitorSettings, Settings};
pub use sight::Sight;
