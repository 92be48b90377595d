#![doc = include_str!("../README.md")]

mod errors;
mod model;
mod names;
mod policy;
mod signals;
mod simulation;
mod solving;
mod tables;
mod tracker;

use pyo3::prelude::pymodule;

/// Partially observable Markov decision processes: read a model, solve it, track a belief, act.
///
/// Rewards and values are in the unit of the model's rewards; costs count negative. Wherever a
/// state, an action or an observation is wanted, its name or its index will do.
#[pymodule]
#[pyo3(name = "vigil_pomdp")]
mod module {
    #[pymodule_export]
    use super::errors::{ParseError, PomdpError};
    #[pymodule_export]
    use super::model::Model;
    #[pymodule_export]
    use super::policy::Policy;
    #[pymodule_export]
    use super::simulation::simulate;
    #[pymodule_export]
    use super::solving::{bound, compact, heuristic, solve, value};
    #[pymodule_export]
    use super::tracker::Tracker;
}
