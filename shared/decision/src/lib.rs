#![doc = include_str!("../README.md")]

mod action_hysteresis;
mod alarm_fusion;
mod decision_process;
mod epoch;
mod evidence;
mod fault_decision;
mod hardware;
mod inputs;
mod mapping;
mod observations;
mod policy;
mod settings;
mod stage_loss;
mod supervisor;
mod symptom_decision;

pub use alarm_fusion::fused_alarm;
pub use inputs::Inputs;
pub use mapping::{Compensation, SupervisorError};
pub use settings::{Evidence, Gate, Recovery, RecoveryAction, Settings};
pub use supervisor::Supervisor;
