//! Models of robots, learned from recorded runs. Reads no file itself.

pub mod bounds;
pub mod channel_learning;
mod correlation;
mod data_hash;
pub mod learning;

mod maxima;
pub mod model_view;
pub mod plausibility;
pub mod split;

pub use correlation::correlation;
pub use data_hash::data_hash;
