//! What the life of faults obeys: `[faults]` of a graph file.

use std::collections::BTreeMap;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use smart_default::SmartDefault;
use vigil_blocks::Severity;

/// The life of faults.
#[derive(Debug, Clone, PartialEq, SmartDefault, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct FaultLifeSettings {
    /// A fault is told once it was present for so long; what flickers adds up.
    #[default(0.3)]
    #[schemars(range(min = 0.0, max = 60.0))]
    pub debounce_s: f64,
    /// It is over once it was absent for so long.
    #[default(5.0)]
    #[schemars(range(min = 0.0, max = 3600.0))]
    pub clear_s: f64,
    /// A fault that is over stays until it is acknowledged.
    #[default(true)]
    pub latch: bool,
    /// Faults with a rule of their own: nodes of the fault tree, `UNKNOWN`, `INPUT`, or a service.
    pub rules: BTreeMap<String, FaultRule>,
}

/// What holds for one fault; what is not given is as for all.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct FaultRule {
    /// See `faults.debounce_s`.
    #[schemars(range(min = 0.0, max = 60.0))]
    pub debounce_s: Option<f64>,
    /// See `faults.clear_s`.
    #[schemars(range(min = 0.0, max = 3600.0))]
    pub clear_s: Option<f64>,
    /// See `faults.latch`.
    pub latch: Option<bool>,
    /// `fault`, or `warning` for what merely costs reserve; `warning` of input and services.
    pub severity: Option<RuleSeverity>,
}

/// How grave a fault is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum RuleSeverity {
    /// The robot does its work with less reserve.
    Warning,
    /// The robot cannot be trusted to do its work.
    Fault,
}

impl From<RuleSeverity> for Severity {
    fn from(severity: RuleSeverity) -> Self {
        match severity {
            RuleSeverity::Warning => Self::Warning,
            RuleSeverity::Fault => Self::Fault,
        }
    }
}
