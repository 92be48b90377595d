//! Detects any deviation from nominal behaviour.
//!
//! [`Detector`] is a pure function of journal entries; [`wiring`] connects it to its ports.

mod detector;
pub mod wiring;

pub use detector::{Detector, DetectorError};
pub use wiring::DetectorStage;
