//! Data sets, learning of models, scoring, reports. Reads files; knows no transport and no clock.

pub mod bounds;
mod correlation;
mod data_hash;
pub mod import;
pub mod learning;
pub mod learning_nominal;
mod maxima;
pub mod model_view;
pub mod plausible;
pub mod report;
pub mod scoring;
pub mod split;

pub use data_hash::data_hash;
