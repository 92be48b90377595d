//! Missions of a decision model: [`simulation`] flies them and compares policies, [`learning`]
//! finds the model's probabilities from recorded ones, [`navigation`] writes the paper's model, and
//! [`recovery`] that of what to do about faults.

pub mod learning;
mod model_text;
pub mod navigation;
pub mod recovery;
pub mod simulation;
