//! Names the fault: a probability for each node of the fault tree, live and offline alike.
//!
//! [`Diagnoser`] is the step of the stage: an [`Identifier`] over the rover's fault models, or a
//! [`ChannelIdentifier`] over a model of channels, and the word BLIND over both.

mod angles;
mod blind_override;
mod channel_evidence;
mod channel_identifier;
mod delay_belief;
mod detection;
mod diagnoser;
mod encoders;
mod engine;
mod fault_rates;
pub mod further;
mod further_likelihood;
mod further_stage;
mod further_state;
mod hypotheses;
mod hypothesis_state;
mod identifier;
mod leaf_map;
mod models;
mod multiple_hypothesis;
mod node_sizes;
mod onset_sight;
mod phase;
mod rate_offsets;
mod reported;
mod ring;
mod risk;
mod servo_fault;
mod set_probabilities;
mod settings;
mod single_fault;
mod sized_ways;
mod sizes;
mod tree_belief;
mod trouble;
mod wheel_update;

pub use channel_identifier::ChannelIdentifier;
pub use diagnoser::Diagnoser;
pub use identifier::{Identifier, Input};
pub use leaf_map::{IdentifierError, LeafMap};
pub use models::Models;
pub use multiple_hypothesis::MultipleHypothesis;
pub use risk::StateRisks;
pub use settings::{IdentifierFilter, PARTICLES_MAX, PARTICLES_MIN, Settings};
pub use tree_belief::TreeBelief;
