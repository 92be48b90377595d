//! Nominal behaviour of any described robot, learned from its own log: what `vigil learn` fits
//! where nothing but healthy driving is known, and what the detector then runs on.
//!
//! Every channel is predicted from the command and from the other channels; what is left is
//! whitened, a run's own offset is learned on the way, and a fault state as in
//! [`crate::learned::form`] says what speaks against the nominal mode.
//!
//! | module | holds |
//! |---|---|
//! | [`model`] | the model file |
//! | [`channel`] | one channel: terms, weights, noise |
//! | [`joint`] | all channels together |
//! | [`observation`] | frames averaged into observations, and the last few of them |
//! | [`track`] | a run's offset and the noise's colour: residuals become white |
//! | [`monitor`] | the detection filter over observations |

/// Axes of a command that a nominal model may have.
pub const AXES: usize = 4;

pub mod channel;
pub mod joint;
pub mod model;
pub mod monitor;
pub mod observation;
pub mod track;

pub use channel::{Channel, Quantity, Regressor, Residual, Tail, Target, Term};
pub use joint::Joint;
pub use model::{Model, Range};
pub use monitor::Monitor;
pub use observation::{History, Observation, Observer};
pub use track::ResidualWhitener;
