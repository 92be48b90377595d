//! What the identifier obeys: `[identifier]` of a graph file.

use std::fmt;

use clap::ValueEnum;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use smart_default::SmartDefault;
use vigil_blocks::PARTICLE_CAPACITY;

/// Fewest particles: chosen by hand. With fewer, most fault modes of the rover have no particle.
pub const PARTICLES_MIN: usize = 32;
/// Most particles: what a block carries.
pub const PARTICLES_MAX: usize = PARTICLE_CAPACITY;
/// Particles of a sampled filter, if the configuration does not say. Chosen: a quarter of the most.
/// Fewer miss rare faults more often; more cost time in proportion.
pub const PARTICLES: usize = 256;

/// The identification filter.
#[derive(Debug, Clone, PartialEq, SmartDefault, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Settings {
    /// The filter, by name. All but `multiple-hypothesis` consider single faults only.
    pub filter: IdentifierFilter,
    /// Particles of a sampled filter: 256 unless given; `look-ahead` has an eighth of them, `imm`
    /// none. Of `multiple-hypothesis`: the most hypotheses kept from one observation to the next,
    /// the most probable ones; all unless given.
    #[schemars(range(min = PARTICLES_MIN, max = PARTICLES_MAX))]
    pub particles: Option<usize>,
    /// Kept frames from which an identification starts.
    #[default(3.0)]
    #[schemars(range(min = 0.5, max = 30.0))]
    pub ring_s: f64,
    /// Prior probability that a fault is one that no model describes.
    #[default(0.01)]
    #[schemars(range(min = 0.0, max = 0.5))]
    pub p_unknown: f64,
}

/// An identification filter, by name.
#[derive(
    Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema, ValueEnum,
)]
#[serde(rename_all = "kebab-case")]
pub enum IdentifierFilter {
    /// Sets of faults and their onsets; `exact` in earlier configurations.
    #[default]
    #[serde(alias = "exact")]
    #[value(alias = "exact")]
    MultipleHypothesis,
    /// The classical particle filter: the model's own transitions.
    Bootstrap,
    /// Faults are tried more often than they occur, and weights pay for it.
    Raised,
    /// The same with a number of particles that follows the belief's spread.
    Adaptive,
    /// As `raised`, and particles stay where a lost track is expensive, by the decision model.
    RiskSensitive,
    /// Faults are tracked together along the fault tree until the data tell them apart.
    Hierarchical,
    /// Every mode is tried on every particle before any is drawn.
    LookAhead,
    /// One Kalman filter per mode, merged.
    Imm,
}

impl fmt::Display for IdentifierFilter {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let value = self.to_possible_value();
        f.write_str(value.as_ref().map_or("", |value| value.get_name()))
    }
}
