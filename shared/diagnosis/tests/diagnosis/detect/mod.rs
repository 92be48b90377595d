//! Tests of the detector.

mod allocation;
mod channels;
mod detector;
mod forms;
mod meaning;
mod monitors;
