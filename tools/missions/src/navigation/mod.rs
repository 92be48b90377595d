//! The navigation model of the paper's section 3, from a few parameters.
//!
//! [`Parameters`] holds what a person can judge: how often an exception arises and passes, what
//! each action mends, which monitor fires in which state, what an outcome says, what things cost.
//! [`generate`] multiplies them out into a `.pomdp` text. The paper publishes the structure, the
//! names and two stories; it publishes no number.
//!
//! Observations are sets of basic ones, named by their members: `EPM_LD`. Given action and state
//! reached, the members are independent, but for what cannot be: EPS (stopped) and EPM (moving)
//! exclude each other, BO answers GO only, ALT and NNA answer NP only and exclude each other.

mod generator;
mod parameters;

pub use crate::parameter_number::NumberError;
pub use generator::generate;
pub use parameters::{
    Outcomes, Parameters, PerException, PerState, Prices, Remedies, Rewards, Symptoms,
};

/// States: nominal, and the paper's exceptions.
pub const STATES: [&str; 7] = ["NOM", "NNP", "HP", "RT", "PP", "WD", "LST"];
/// Actions.
pub const ACTIONS: [&str; 7] = ["FP", "NP", "RL", "GO", "MA", "SH", "GU"];
/// Actions that end the task, or take it out of the robot's hands.
pub const ENDS: [&str; 2] = ["SH", "GU"];
/// Observations in which nothing speaks for an exception.
pub const QUIET: [&str; 3] = ["none", "BO", "ALT"];
