//! The identifier's belief: what is wrong?

use crate::block::block;
use crate::detection::EVIDENCE;
use crate::header::{Cause, Header};
use crate::layout::part;

/// Capacity of nodes of the fault tree.
pub const FAULT_NODES: usize = 64;
/// Capacity of reported fault sets.
pub const FAULT_SETS: usize = 8;
/// [`FaultBelief::mode`] when no known fault explains the data.
pub const MODE_UNKNOWN: u32 = 1000;
/// [`FaultBelief::mode`] when two or more faults are present.
pub const MODE_MULTIPLE: u32 = 1001;
/// [`FaultBelief::mode`] without valid input for a second.
pub const MODE_BLIND: u32 = 1002;

/// [`FaultBelief::identifying`] while what was kept from before an alarm is worked off.
pub const CATCHING_UP: u32 = 2;

impl FaultBelief {
    /// True before the first result about an alarm.
    #[must_use]
    pub const fn is_catching_up(&self) -> bool {
        self.identifying == CATCHING_UP
    }
}

/// The word for a mode that is no node of the fault tree.
#[must_use]
pub const fn mode_word(mode: u32) -> Option<&'static str> {
    match mode {
        MODE_UNKNOWN => Some("UNKNOWN"),
        MODE_MULTIPLE => Some("MULTIPLE"),
        MODE_BLIND => Some("BLIND"),
        _ => None,
    }
}

part! {
/// A set of leaves of the fault tree and its probability.
pub struct FaultSet, size 16 {
    /// Bit i: node i of the tree (always a leaf) is in the set; 0 is the nominal mode.
    pub leaves: u64,
    /// Probability that exactly this set is present.
    pub p: f64,
}
}

block! {
    /// Written by the identifier every cycle. Before an alarm it reports nominal with
    /// probability 1 - p_fault and the rest as unknown.
    pub struct FaultBelief, size 3008 {
        /// Common header.
        pub header: Header,
        /// The journal entry behind this belief.
        pub cause: Cause,
        /// Run of the frame.
        pub run_id: u64,
        /// Hash of the fault tree that gives the nodes their meaning.
        pub tree_hash: u64,
        /// Probability of each node: that a leaf's fault is present, alone or with others; that any
        /// fault below an abstract node is. Node 0 is nominal: no fault at all.
        pub p: [f64; FAULT_NODES],
        /// The same before this cycle's data: prediction from the last cycle.
        pub p_predicted: [f64; FAULT_NODES],
        /// Probability that no modelled fault explains the data.
        pub p_unknown: f64,
        /// The same before this cycle's data.
        pub p_unknown_predicted: f64,
        /// Most probable sets of leaves, in falling order.
        pub sets: [FaultSet; FAULT_SETS],
        /// Entropy of the distribution over sets and unknown, nats.
        pub entropy: f64,
        /// Why this diagnosis and not the next best one: by channel, how much more the readings
        /// since the onset are expected under it than under `runner_up`, natural log-likelihood;
        /// see [`crate::Evidence`]. 0 while nothing is diagnosed.
        pub channel_evidence: [f64; EVIDENCE],
        /// Expected size of each node's fault, given that it is present, in the unit of its
        /// `size_kind`; 0 without a size.
        pub size: [f64; FAULT_NODES],
        /// Standard deviation of `size`, in the same unit.
        pub size_sd: [f64; FAULT_NODES],
        /// Probability of `mode`.
        pub p_mode: f64,
        /// Capture time of the frame that raised the alarm, ns; 0 before an alarm.
        pub alarm_t_capture_ns: u64,
        /// Most probable onset of the most probable fault, capture time ns; 0 if none.
        pub onset_t_capture_ns: u64,
        /// Mode, memoryless: a node's index, [`MODE_UNKNOWN`], [`MODE_MULTIPLE`] or [`MODE_BLIND`].
        pub mode: u32,
        /// Reported mode: follows `mode` with hysteresis.
        pub reported: u32,
        /// Changes of `reported` so far.
        pub reported_change_count: u32,
        /// The next best explanation that is not the best and one more fault: a node's index (0 is
        /// nominal), [`MODE_UNKNOWN`] or [`MODE_MULTIPLE`].
        pub runner_up: u32,
        /// Particles or hypotheses allowed at present; fewer than configured while time is short.
        pub particle_limit: u32,
        /// Changes of `mode` so far.
        pub mode_change_count: u32,
        /// Nodes in use.
        pub node_count: u32,
        /// Sets in use.
        pub set_count: u32,
        /// 1 while identifying (an alarm stands or a fault is believed), [`CATCHING_UP`] before the
        /// first result of that; 0 while watching, or while nothing is known yet of an alarm that
        /// stood before the identifier began.
        pub identifying: u32,
        /// Steps that met impossible or non-finite evidence and kept the prediction.
        pub degenerate_count: u32,
        /// In which way each node's component is most probably broken, given that it is: a
        /// [`crate::SizeKind`], which gives `size` its unit.
        pub size_kind: [u32; FAULT_NODES],
    }
}
