#![doc = include_str!("../README.md")]

mod alarm_fusion;
mod answerable;
mod decision_process;
mod despot_settings;
mod epoch;
mod error;
mod fault_decision;
mod fault_life;
mod hardware_belief;
mod hearing;
mod inputs;
mod joint_states;
mod kept;
mod latch;
mod mapping;
mod observations;
mod policy;
mod settings;
mod settling;
mod stage_loss;
mod state_belief;
pub mod state_names;
mod states;
mod supervisor;
mod switching_cost;
mod symptom_decision;
mod wheels;

pub use alarm_fusion::fused_alarm;
pub use despot_settings::DespotSettings;
pub use error::SupervisorError;
pub use fault_life::{
    CycleDecision, FaultLife, FaultLifeSettings, FaultRule, FaultRuleError, LifeInput, LifeOrder,
    RuleSeverity,
};
pub use inputs::Inputs;
pub use mapping::Compensation;
pub use observations::actions_with_outcome;
pub use settings::{Counts, Evidence, Gate, OwnSymptom, Recovery, RecoveryAction, Settings};
pub use state_belief::MOVED;
pub use supervisor::Supervisor;
