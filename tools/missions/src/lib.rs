//! Missions of a decision model: [`simulation`] flies them and compares policies, [`learning`]
//! finds the model's probabilities from recorded ones, [`navigation`] writes the paper's model.

pub mod learning;
pub mod navigation;
pub mod simulation;
