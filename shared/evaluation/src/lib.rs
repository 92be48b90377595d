//! Data sets, learning of models, scoring, reports. Reads files; knows no transport and no clock.

pub mod cases;
mod correlation;
pub mod derived;
pub mod frames;
pub mod import;
pub mod labels;
pub mod learning;
pub mod learning_nominal;
pub mod plausible;
pub mod report;
pub mod scoring;
pub mod split;
mod table;
