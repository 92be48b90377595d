//! Learned behaviour: what `vigil learn` fits and the detector and identifier read.
//!
//! | module | holds |
//! |---|---|
//! | [`model`] | the model file |
//! | [`motion`] | displacement per commanded metre, and its noise |
//! | [`wheels`] | wheel rates and steering angles, and what an encoder says about its wheel |
//! | [`BodyLag`] | how the body follows a changing command, learned on the way |
//! | [`observation`] | frames averaged over about the learned interval |
//! | [`Observer`] | builds observations from frames |
//! | [`motion_modes`] | how a robot may move: nominal, wheels stuck, servo off, unknown |
//! | [`FaultRates`] | how often faults come and go |
//! | [`steer_reading`] | what a steering angle says of its servo |
//! | [`wheel_context`] | what ground and load make of the wheels' rates, learned on the way |
//! | [`wheel_evidence`] | what the wheels say, for everything that each may be doing |
//! | [`switching`] | the learned model as a hybrid system, for filters that take any |
//! | [`Healthy`] | what is believed of the robot as long as it is healthy |
//! | [`noise_scale`] | how much noisier the sensors are than the learned ones |
//! | [`calibration`] | alarm thresholds for a stated mean time between false alarms |
//! | [`form`] | what the detection filter's fault state says of a residual |
//! | [`troubles`] | silent sensors, and motion that nobody commanded |
//! | [`further`] | gyro and motor currents: what was learned of them, and read |
//! | [`current_effects`] | what a weak motor or a stuck wheel makes of all currents |
//! | [`further_watch`] | gyro and currents beside what is expected of a healthy robot |
//! | [`repeats`] | whether a sensor repeats itself exactly |
//! | [`past_rates`] | the rates that the wheels had some moments ago |
//! | [`channels`] | which channels take part |
//! | [`monitor`] | the detection filter over observations |

mod body_lag;
pub mod calibration;
pub mod channels;
mod compensation;
mod current_context;
pub mod current_effects;
mod encoder_ways;
mod fault_rates;
mod faults;
pub mod form;
pub mod further;
mod further_evidence;
pub mod further_watch;
mod healthy;
mod lateness;
pub mod model;
pub mod monitor;
pub mod motion;
pub mod motion_modes;
pub mod noise_scale;
pub mod observation;
pub(crate) mod observer;
pub mod past_rates;
mod provenance;
mod reading;
pub mod repeats;
mod settling;
pub mod steer_reading;
pub mod switching;
mod together;
pub mod troubles;
pub mod wheel_context;
pub mod wheel_evidence;
pub mod wheels;

pub use body_lag::BodyLag;
pub use calibration::Calibration;
pub use fault_rates::FaultRates;
pub use form::Form;
pub use further::{Further, FurtherModel};
pub use healthy::{Healthy, triangle};
pub use model::{Model, ModelError};
pub use monitor::Monitor;
pub use motion::{Curve, MotionModel};
pub use motion_modes::{MotionMode, Mover, motion_modes, steer_modes};
pub use noise_scale::{NoiseScales, OutlierRates};
pub use observation::Observation;
pub use observer::{FrameOutcome, Observer};
pub use reading::Reading;
pub use steer_reading::{ANY_ANGLE_SD_RAD, SteerReading};
pub use switching::Switching;
pub use troubles::Troubles;
pub use wheel_context::WheelContext;
pub use wheel_evidence::WheelEvidence;
pub use wheels::{EncoderModel, EncoderState, RateModel};
