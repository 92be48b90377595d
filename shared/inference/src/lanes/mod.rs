//! A particle filter for planar robots whose modes move them by tables, made for speed: thousands
//! of particles in microseconds.
//!
//! | file | holds |
//! |---|---|
//! | `model` | the robot's tables, checked |
//! | `weighing` | an observation, as the likelihood that the kernels read |
//! | `steps` | the filter: order of the passes, ways out |
//! | `kernels` | the passes over the particles, written once for all processors |
//! | `vector` | what the passes ask of a processor: 16 lanes |
//! | `plain`, `processor` | the lanes as arrays, as AVX2 and as AVX-512; the choice at run time |
//! | `elementary`, `random`, `alias` | exp, ln, sine; normal draws; draws of modes |
//! | `cloud` | the particles' memory |
//! | [`linear`] | another filter on the same lanes: look-ahead, for linear models |
//!
//! A step is: ancestors from a running maximum; gather; mode, pose, weight; sums in one pass over
//! what is still in the cache; ancestors of the next step by a prefix sum and one scatter. There
//! is no branch on a particle's fate, and no second pass for the largest weight: weights are
//! relative to a known bound, and computed again only if that was far off.
//!
//! Poses are kept in single precision from the origin: within a kilometre they are exact to a tenth
//! of a millimetre; a robot that drives farther begins anew with its origin moved.

mod alias;
mod cloud;
mod elementary;
mod kernels;
pub mod linear;
mod model;
mod plain;
mod processor;
mod random;
mod steps;
mod vector;
mod weighing;

#[cfg(test)]
mod tests;

pub use model::{
    MAGNITUDE_MAX, MEASUREMENT_SD_MIN, MODES_MAX, ModelError, PlanarModel, PlanarParameters,
    WHEELS_MAX,
};
pub use processor::Level;
pub use steps::{Event, LaneFilter, PARTICLES_MAX, Step};
pub use weighing::Observation;
