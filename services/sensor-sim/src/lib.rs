//! The sensor source: the simulated rover, recorded frames, or frames that arrive at a socket.
//!
//! - [`World`]: the rover on its soil, its sensors, and the faults and disturbances of both;
//! - [`Obedience`]: what the rover makes of the supervisor's actions;
//! - [`Navigator`]: the way that the rover finds in a corridor, around or through what blocks it;
//! - [`Simulation`]: these together;
//! - [`Playback`]: recorded frames, one run after the other;
//! - [`Schedule`]: injections that are due at given times.
//!
//! Nothing here knows a clock or a port: times are parameters, and equal input and seed give equal
//! bits. The binary wires this to the graph.

mod arrival_clock;
mod assemble;
mod check;
mod disturbed;
mod drive;
mod encoders;
mod history;
mod navigation;
mod noise;
mod obedience;
mod playback;
mod pose_sensor;
mod schedule;
mod simulation;
mod soil;
mod wiring;
mod world;

pub use arrival_clock::{ArrivalClock, Here};
pub use assemble::{SensorSource, assemble};
pub use check::WorldError;
pub use drive::{ACCELERATION_MAX_M_S2, CURVATURE_RATE_MAX_1_M_S, DriveCommand};
pub use encoders::{NOISE_MAX_RAD_S, NOISE_MIN_RAD_S};
pub use navigation::{Navigator, NavigatorEvent, Order};
pub use obedience::{EffectiveCommand, Obedience};
pub use playback::{Playback, PlaybackError};
pub use schedule::Schedule;
pub use simulation::Simulation;
pub use wiring::{Listen, PlaybackSource, SimulatorSource, SocketStage};
pub use world::{CURRENT_PER_TORQUE_A_N_M, Truth, World};
