//! What the decision obeys: `[supervisor]` of a graph file.

use std::collections::BTreeMap;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use smart_default::SmartDefault;
use vigil_blocks::RecoveryKind;

use crate::despot_settings::DespotSettings;

/// The decision system.
#[derive(Debug, Clone, PartialEq, SmartDefault, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Settings {
    /// What updates the belief over the decision model's states: `faults` if they are leaves, nodes
    /// or kinds of the fault tree, `symptoms` if the model's observations are sets of symptoms and
    /// outcomes (`EPM_LD`, `none`).
    pub evidence: Evidence,
    /// With `symptoms`: the exception of a robot that is lost, as states name it (`LST`). What the
    /// identifier calls unknown is a fault that nobody has modelled, or a pose that jumped. Without
    /// it the unknown is a fault.
    pub lost_state: Option<String>,
    /// With `symptoms`: symptoms of your own, by the name that the decision model's observations
    /// have for them, beside EPS, EPM, LD, SD, BO, ALT and NNA. The robot's publisher sets their
    /// bits in the frame.
    pub symptoms: BTreeMap<String, OwnSymptom>,
    /// Policy: `qmdp`, `mls` (the best action of the most likely state), `av` (action voting),
    /// `fib` (fast informed bound), or one of these with dual control, which gathers information
    /// while the belief is too uncertain: `dm-X` about the state, `adm-X` about the best action.
    /// Or `point-based`, solved beforehand: see `policy_file`. Or `despot`, which plans while it
    /// decides: see `[supervisor.despot]`.
    #[default = "qmdp"]
    pub policy: String,
    /// File that `vigil pomdp solve MODEL --out FILE` has written for the decision model; relative
    /// to the graph file. Required by `point-based`; `despot` may end its plans with it.
    pub policy_file: Option<String>,
    /// With `despot`: what its search may spend.
    pub despot: DespotSettings,
    /// Dual control: information is gathered above this entropy, where 0 is certain; 1: never.
    #[default(0.5)]
    #[schemars(range(min = 0.0, max = 1.0))]
    pub threshold: f64,
    /// Dual control: whose entropy the threshold is for; `state` for `dm-X` and `action` for
    /// `adm-X` unless given.
    pub gate: Option<Gate>,
    /// Dual control: actions of the decision model that may be taken for information. Required by
    /// `dm-X` and `adm-X`: a restart or a call for help must not be made merely to know more.
    pub information_actions: Vec<String>,
    /// Dual control: after this many steps for information in a row without falling entropy, X acts
    /// until it has fallen; 0: never.
    #[default(5)]
    #[schemars(range(min = 0, max = 1000), extend("x-unit" = "steps"))]
    pub stall_guard_steps: u32,
    /// Dual control as published in 2002: gated on the state's entropy, any action may be taken
    /// for information, no guard.
    pub as_published: bool,
    /// With `faults`, and a policy that compares values: what a change of action costs, in the
    /// decision model's rewards. An action is left for another once that would have earned this
    /// much more, summed over time: what is much better is taken at once, and two actions that
    /// take turns in being better do not alternate. 0: always the best.
    #[schemars(range(min = 0.0, max = 1e6))]
    pub switching_cost: f64,
    /// Interval between decision epochs. A belief that moves opens a decision at once.
    /// With `symptoms` this is the longest epoch, at least 1000: an outcome or a new symptom ends
    /// it too; an action that the robot says is running has until `action_max_s`.
    #[default(100.0)]
    #[schemars(range(min = 1.0, max = 60_000.0))]
    pub epoch_ms: f64,
    /// With `symptoms`: an action that the robot says is running counts as failed after this long,
    /// no less than the longest that `[navigation]` allows. Waiting for help has no limit.
    #[default(60.0)]
    #[schemars(range(min = 1.0, max = 3600.0))]
    pub action_max_s: f64,
    /// Factor on the speed of `go_on` until the detector is armed: before that no alarm can rise.
    #[default(0.5)]
    #[schemars(range(min = 0.0, max = 1.0))]
    pub arming_speed_scale: f64,
    /// Validity of a published action, as a multiple of the period; 20 ms at least.
    #[default(10.0)]
    #[schemars(range(min = 1.0, max = 1000.0), extend("x-unit" = "periods"))]
    pub validity_periods: f64,
    /// What each action of the decision model makes the robot do, by the action's name.
    pub actions: BTreeMap<String, RecoveryAction>,
}

/// A symptom of the user's own.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct OwnSymptom {
    /// Its bit in the frame's symptoms.
    #[schemars(range(min = 8, max = 31))]
    pub bit: u32,
    /// When it counts.
    #[serde(default)]
    pub counts: Counts,
}

impl OwnSymptom {
    /// The set that holds it alone.
    #[must_use]
    pub const fn set(self) -> u32 {
        1 << self.bit
    }
}

/// When a symptom counts as one of a decision epoch's.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Counts {
    /// When it rises: an event, such as a bump.
    #[default]
    Rising,
    /// When it rises, and while it stands at the end of an epoch: a state, such as an empty
    /// battery.
    Standing,
    /// With the outcome that the robot reports of an action.
    Outcome,
}

/// What updates the belief over the decision model's states.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Evidence {
    /// The identifier's belief over the leaves of the fault tree.
    #[default]
    Faults,
    /// Symptoms and outcomes of actions.
    Symptoms,
}

/// Whose entropy decides whether information is gathered.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Gate {
    /// The entropy of the belief over states.
    State,
    /// The entropy of the states' votes for their best actions.
    Action,
}

/// What an action makes the robot do.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct RecoveryAction {
    /// Kind of the recovery.
    pub kind: Recovery,
    /// Factor on the commanded speed. Unless given: 0.5 for `slow_down`, 0.7 for `compensate` and
    /// `limp_home`, 0 for what is done standing (`stop`, `call_for_help`, `new_path`,
    /// `relocalise`, `give_up`, `own`), else 1.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub speed_scale: Option<f64>,
    /// Whether the robot reports that it is done. Unless given: not for what goes on (`go_on`,
    /// `slow_down`, `stop`, `compensate`, `ignore_encoder`, `limp_home`), else yes.
    pub has_end: Option<bool>,
    /// With `symptoms`: the longest epoch of this action, in place of `supervisor.epoch_ms`.
    #[schemars(range(min = 100.0, max = 60_000.0))]
    pub epoch_ms: Option<f64>,
}

/// Kind of a recovery action; see `vigil_blocks::RecoveryKind`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Recovery {
    /// Drive as planned.
    GoOn,
    /// Drive as planned, slower.
    SlowDown,
    /// Stop.
    Stop,
    /// Counter-steer by the learned yaw offset of the stuck wheel.
    Compensate,
    /// Drive on without trusting one wheel's encoder.
    IgnoreEncoder,
    /// Drive on with several faults: counter-steer against each stuck wheel, trust no broken
    /// encoder. Of faults it answers those with which the robot can be driven: no two stuck wheels
    /// on one side.
    LimpHome,
    /// Stop and call for help.
    CallForHelp,
    /// Ask the planner for another path.
    NewPath,
    /// Find the own place anew.
    Relocalise,
    /// Look for an opening and go through it.
    GoThrough,
    /// Move away from the present place.
    MoveAway,
    /// Give this task up.
    GiveUp,
    /// One of your own: the robot's adapter knows it by its number in the decision model.
    Own,
}

impl From<Recovery> for RecoveryKind {
    fn from(recovery: Recovery) -> Self {
        match recovery {
            Recovery::GoOn => Self::GoOn,
            Recovery::SlowDown => Self::SlowDown,
            Recovery::Stop => Self::Stop,
            Recovery::Compensate => Self::Compensate,
            Recovery::IgnoreEncoder => Self::IgnoreEncoder,
            Recovery::LimpHome => Self::LimpHome,
            Recovery::CallForHelp => Self::CallForHelp,
            Recovery::NewPath => Self::NewPath,
            Recovery::Relocalise => Self::Relocalise,
            Recovery::GoThrough => Self::GoThrough,
            Recovery::MoveAway => Self::MoveAway,
            Recovery::GiveUp => Self::GiveUp,
            Recovery::Own => Self::Own,
        }
    }
}
