#![doc = include_str!("../README.md")]

mod action_gate;
mod active_disturbances;
mod arrival_clock;
mod assemble;
mod check;
mod delay_line;
mod drive;
mod encoders;
mod injection_schedule;
mod navigation;
mod noise;
mod playback;
mod pose_sensor;
mod simulation;
mod soil;
mod wiring;
mod world;

pub use action_gate::{ActionGate, EffectiveCommand};
pub use arrival_clock::{ArrivalBatch, ArrivalClock};
pub use assemble::{SensorSource, assemble};
pub use check::WorldError;
pub use drive::{ACCELERATION_MAX_M_S2, CURVATURE_RATE_MAX_1_M_S, DriveCommand};
pub use encoders::{NOISE_MAX_RAD_S, NOISE_MIN_RAD_S};
pub use injection_schedule::InjectionSchedule;
pub use navigation::{Help, NavigationCondition, Navigator, NavigatorEvent, WayAhead};
pub use playback::{Playback, PlaybackError};
pub use simulation::Simulation;
pub use wiring::{
    ListenAddresses, PlaybackSource, SimulatorSource, SocketInputs, SocketStage, VerdictNames,
};
pub use world::{CURRENT_PER_TORQUE_A_N_M, TrueState, World};
