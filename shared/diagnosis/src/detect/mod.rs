//! Finds any departure from nominal behaviour: [`Detector`].

mod blindness;
mod detection_filter;
mod detector;
mod monitors;
mod pace;
mod publisher;
mod settings;

pub use detector::{Detector, DetectorError};
pub use monitors::Monitors;
pub use settings::{Form, MonitorSettings, NullSettings, Settings};
