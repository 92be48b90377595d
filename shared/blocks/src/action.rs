//! The supervisor's decision: what to do.

use strum::FromRepr;
use vigil_checkpoint::CheckpointValue;

use crate::answered_wheels::AnsweredWheels;
use crate::block::block;
use crate::header::{Cause, Header};

/// Capacity of the decision model's states.
pub const DECISION_STATES: usize = 64;
/// Capacity of the decision model's actions.
pub const DECISION_ACTIONS: usize = 32;

block! {
    /// Written by the supervisor every cycle; valid until `valid_until_ns`.
    pub struct Action, size 1008 {
        /// Common header.
        pub header: Header,
        /// The journal entry behind this decision.
        pub cause: Cause,
        /// Run of the frame.
        pub run_id: u64,
        /// Counts decisions: rises when `action` or its parameters change. From 1.
        pub decision_seq: u64,
        /// `CLOCK_MONOTONIC` ns after which the robot must no longer obey this block, but stop.
        pub valid_until_ns: u64,
        /// Hash of the decision model that gives states and actions their meaning.
        pub model_hash: u64,
        /// Belief over the decision model's states.
        pub belief: [f64; DECISION_STATES],
        /// What the policy thinks of each action, the larger the better; `value_kind` says what it
        /// is. Finite.
        pub value: [f64; DECISION_ACTIONS],
        /// Entropy of the belief, normalised to 0..1.
        pub entropy: f64,
        /// Entropy of the states' votes for their best actions, normalised to 0..1: doubt about
        /// what to do.
        pub action_entropy: f64,
        /// Value of the chosen action minus the runner-up's.
        pub margin: f64,
        /// How well the last evidence was predicted: with symptoms the natural logarithm of its
        /// probability; with faults the mean of that of the predicted belief, over the belief.
        pub log_evidence: f64,
        /// Speed factor to apply, 0..1.
        pub speed_scale: f64,
        /// Curvature to command: `curvature_gain * curvature + curvature_offset`.
        pub curvature_gain: f64,
        /// See `curvature_gain`; 1/m.
        pub curvature_offset: f64,
        /// Index of the chosen action in the decision model.
        pub action: u32,
        /// What the robot is to do: a [`RecoveryKind`].
        pub kind: u32,
        /// Stuck wheels that the action is about, as bits in the order of the robot's wheels.
        pub stuck_wheels: u16,
        /// Wheels whose encoders are not to be trusted, as bits.
        pub broken_encoders: u16,
        /// How the action was chosen: a [`ControlMode`].
        pub control_mode: u32,
        /// States in use.
        pub state_count: u32,
        /// Actions in use.
        pub action_count: u32,
        /// Observations that were impossible under the belief so far.
        pub impossible_count: u32,
        /// Bit 0: identifier lost; bit 1: detector lost.
        pub lost_stages: u32,
        /// What `value` is: a [`ValueKind`].
        pub value_kind: u32,
        /// 1 while the alarm stands: the detector's, unless the identifier has found the robot
        /// nominal since.
        pub alarm: u32,
        /// Capture time of the frame that raised it, ns; 0 without alarm.
        pub alarm_t_capture_ns: u64,
        /// Alarms raised so far.
        pub alarm_count: u32,
        /// Why nothing is seen: a [`crate::Blindness`]; 0 while something is.
        pub blind: u32,
        /// Which belief the model's last step was of: how many had begun anew before, at a reset or
        /// at a new run that was not the success of an action.
        pub step_belief: u64,
        /// Steps of the decision model so far, with symptoms; 0 with faults, whose evidence is no
        /// observation of the model.
        pub step_count: u64,
        /// Action of the model's last step.
        pub step_action: u32,
        /// Observation of the model's last step; `u32::MAX` for a set of symptoms that the model
        /// does not have.
        pub step_observation: u32,
    }
}

impl Action {
    /// The wheels that the action is about.
    #[must_use]
    pub const fn answered(&self) -> AnsweredWheels {
        AnsweredWheels {
            stuck: self.stuck_wheels,
            encoders: self.broken_encoders,
        }
    }

    /// Says which wheels the action is about.
    pub const fn answer(&mut self, wheels: AnsweredWheels) {
        (self.stuck_wheels, self.broken_encoders) = (wheels.stuck, wheels.encoders);
    }
}

/// What the robot is to do.
#[derive(Debug, Clone, Copy, PartialEq, Eq, FromRepr, CheckpointValue)]
#[repr(u32)]
pub enum RecoveryKind {
    /// Nothing decided: the robot stops.
    None = 0,
    /// Drive as planned.
    GoOn = 1,
    /// Drive as planned, slower.
    SlowDown = 2,
    /// Stop.
    Stop = 3,
    /// Counter-steer against a dragging wheel.
    Compensate = 4,
    /// Drive on without trusting one wheel's encoder.
    IgnoreEncoder = 5,
    /// Stop and call for help.
    CallForHelp = 6,
    /// Stand, and ask the planner for another path to the goal.
    NewPath = 7,
    /// Stand, and find the own place anew.
    Relocalise = 8,
    /// Look closely for an opening past what blocks the way, and go through it.
    GoThrough = 9,
    /// Move away from the present place.
    MoveAway = 10,
    /// Stop for good: this task is given up.
    GiveUp = 11,
    /// An action of the user's own: `action` says which.
    Own = 12,
    /// Drive on with several faults: counter-steer against every stuck wheel, trust no broken
    /// encoder.
    LimpHome = 13,
}

/// Why a robot does not obey an action, and stops itself.
#[derive(Debug, Clone, Copy, PartialEq, Eq, FromRepr)]
#[repr(u32)]
pub enum ActionRejection {
    /// There is no action, or it says that nothing is decided.
    Nothing = 1,
    /// Its validity has passed.
    Expired = 2,
    /// Its kind is not one that this version knows.
    UnknownKind = 3,
    /// A parameter is not finite.
    NotFinite = 4,
    /// The speed factor is not within 0..1.
    OutOfRange = 5,
}

/// What the values of actions are.
#[derive(Debug, Clone, Copy, PartialEq, Eq, FromRepr)]
#[repr(u32)]
pub enum ValueKind {
    /// Discounted reward to come under the policy.
    Value = 1,
    /// How much of the belief speaks for the action, 0 to 1.
    Votes = 2,
    /// The entropy to expect after the action, 0 to 1, negative: a step for information.
    Entropy = 3,
}

/// How an action was chosen.
#[derive(Debug, Clone, Copy, PartialEq, Eq, CheckpointValue)]
#[repr(u32)]
pub enum ControlMode {
    /// By the policy, from a belief with fresh evidence.
    Policy = 1,
    /// To gather information (dual control).
    Dual = 2,
    /// From the detector's belief alone, because the identifier is lost.
    Fallback = 3,
    /// By rule, because no usable belief is left: stop.
    Safe = 4,
}
