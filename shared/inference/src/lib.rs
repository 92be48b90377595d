#![doc = include_str!("../README.md")]

pub mod adaptive;
pub mod ages;
pub mod alternative;
pub mod angle;
pub mod bank;
pub mod bootstrap;
pub mod constant;
pub mod departure;
pub mod e_detector;
pub mod ending;
pub mod filter;
pub mod gaussian;
pub mod hierarchical;
pub mod hybrid;
pub mod logspace;
pub mod look_ahead;
pub mod merged;
mod onsets;
pub mod outlier;
pub mod proposal;
pub mod resample;
pub mod risk;
pub mod size;
pub mod slow_state;
pub mod track;
mod weights;
pub mod windowed;
