//! Missions of a decision model: [`simulation`] flies them and compares policies, [`learning`]
//! finds the model's probabilities from recorded ones. Models are written by [`navigation`] (the
//! paper's), [`exceptions`] (of navigation and hardware) and [`recovery`] (of faults).

mod counting;
pub mod exceptions;
pub mod learning;
mod model_text;
pub mod navigation;
mod parameter_number;
pub mod recovery;
pub mod simulation;

pub use counting::{Fit, FittedChance};
