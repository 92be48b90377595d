//! The behaviour of any described robot, learned from its own log of healthy driving, and what each
//! fault of a sensor or a drive would change of it.
//!
//! Every channel is predicted from the command. What is left over the last four seconds is weighed
//! under the joint law of all channels, against each way in which each component can fail.
//!
//! | module | holds |
//! |---|---|
//! | [`component`] | channels, drives and components of a robot |
//! | [`coverage`] | which commands a log covers |
//! | [`observation`] | frames averaged into observations, and the last few of them |
//! | [`channel`] | one channel: terms, weights, noise |
//! | [`prediction`] | the predictions of all channels |
//! | [`window`] | the last seconds of residuals and predictions, in blocks |
//! | [`law`], [`directions`] | the joint law of the residuals, and its principal directions |
//! | [`scatter`] | the law of how rough they are |
//! | [`fault_kind`] | the ways in which a component fails |
//! | [`shift`] | a change of several channels, each by an amount of its own |
//! | [`signature`] | what labelled runs showed of a declared fault |
//! | [`orders`] | what channels show in step with the turns of a wheel |
//! | [`turning`] | what labelled runs showed of a fault that comes back with them |
//! | [`context_change`] | changes that are no fault, by labelled runs |
//! | [`declared_faults`] | the faults that a description declares, weighed |
//! | [`bank`] | all faults, weighed |
//! | [`level`] | the level of a channel that wanders without a fault |
//! | [`belief`] | what is believed of components |
//! | [`monitor`] | detection, and what is believed of each component |
//! | [`model`] | the model file |
//! | [`tree`] | the fault tree of a robot |

use crate::fault_table::DECLARED_MAX;

/// Axes of a command that a model may have.
pub const AXES: usize = 4;
/// Channels of a model at most.
pub const CHANNELS_MAX: usize = 28;
/// Drives at most: one for each wheel, or each axis.
pub const DRIVES_MAX: usize = 8;
/// Components at most.
pub const COMPONENTS_MAX: usize = CHANNELS_MAX + DRIVES_MAX + DECLARED_MAX;

pub mod bank;
pub mod belief;
pub mod channel;
pub mod component;
pub mod context_change;
pub mod coverage;
pub mod declared_faults;
pub mod directions;
pub mod fault_kind;
mod identity;
pub mod law;
pub mod level;
pub mod model;
mod model_check;
pub mod monitor;
pub mod observation;
pub mod orders;
pub mod prediction;
pub mod scatter;
pub mod shift;
pub mod signature;
mod square;
pub mod tree;
pub mod turning;
mod watched;
pub mod window;

pub use channel::{Channel, Regressor, Scales, Term};
pub use component::{Component, Places, Quantity, Target, components, drives, targets};
pub use coverage::{Combinations, Range};
pub use model::Model;
pub use monitor::Monitor;
pub use observation::{History, Observation, Observer};
pub use orders::WheelOrders;
