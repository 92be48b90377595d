//! One decision cycle.

use crate::settings::{self, Settings};
use vigil_blocks::{Action, DetectionBelief, Entry, FaultBelief};
use vigil_pomdp::{PointBased, Pomdp};
use vigil_robot::Description;
use vigil_robot::FaultTree;

use crate::exceptions::Exceptions;
use crate::leaves::Leaves;
use crate::mapping::{Compensation, SupervisorError};
use crate::watch::Watch;

/// What a cycle of the supervisor is told; at least one of the two is there.
#[derive(Debug, Clone, Copy)]
pub struct Inputs<'a> {
    /// The identifier's belief, if it came.
    pub diagnosis: Option<&'a FaultBelief>,
    /// The newest belief of the detector, if it is new. One that a missed deadline caused tells
    /// whether the detector sees anything, and nothing else.
    pub detection: Option<&'a DetectionBelief>,
}

/// Tracks the belief of the recovery POMDP and chooses actions.
pub struct Supervisor {
    watch: Watch,
    of: Of,
}

/// What the decision model is about.
enum Of {
    /// Faults: leaves of the fault tree.
    Leaves(Box<Leaves>),
    /// Exceptions of the navigation, told by symptoms.
    Exceptions(Box<Exceptions>),
}

impl Supervisor {
    /// Builds a supervisor for a decision model: with `settings.evidence` of faults, its states
    /// are the leaves of `tree`; of symptoms, its observations are sets of them. `solved` is what
    /// the policy `point-based` decides by, the others do without. After
    /// `blind_after_misses` misses in a row without any detection no belief is usable, and the
    /// robot stops.
    ///
    /// # Errors
    /// [`SupervisorError`] naming what does not fit.
    pub fn new(
        model: Pomdp,
        solved: Option<&PointBased>,
        tree: &FaultTree,
        robot: &Description,
        settings: &Settings,
        compensation: Vec<Compensation>,
        blind_after_misses: u32,
    ) -> Result<Self, SupervisorError> {
        let of = match settings.evidence {
            settings::Evidence::Faults => Of::Leaves(Box::new(Leaves::new(
                model,
                solved,
                tree,
                robot,
                settings,
                compensation,
                blind_after_misses,
            )?)),
            settings::Evidence::Symptoms => Of::Exceptions(Box::new(Exceptions::new(
                model,
                solved,
                tree,
                settings,
                blind_after_misses,
            )?)),
        };
        let watch = Watch::new(settings.arming_speed_scale);
        Ok(Self { watch, of })
    }

    /// Takes one journal entry and writes the decision. On misses belief and decision stand (what
    /// a late diagnosis says is folded in when it comes), until no stage is heard any more. While
    /// the detector sees nothing the robot stops, and beliefs stand. Input that is not a
    /// probability, or of another fault tree, is counted in `impossible_count` and refused; a
    /// refused diagnosis counts as missed. Every field of `action` is written but the header's
    /// epoch, sequence number and times, the cause and `valid_until_ns`: those belong to the
    /// ports. Allocates nothing, never panics; no field is ever NaN.
    // Never merged into its caller, so that its instructions can be counted.
    #[inline(never)]
    pub fn step(&mut self, entry: Entry<Inputs<'_>>, action: &mut Action) {
        let entry = self.watch.take(entry);
        let seen = self.watch.seen();
        match &mut self.of {
            Of::Leaves(leaves) => leaves.step(entry, seen, action),
            Of::Exceptions(exceptions) => exceptions.step(entry, seen, action),
        }
        self.watch.write(action);
    }

    /// The action that stands whatever is believed: a call for help, or the end of the task. It
    /// stands until a new run or a reset.
    #[must_use]
    pub fn latched(&self) -> Option<usize> {
        match &self.of {
            Of::Leaves(leaves) => leaves.latched(),
            Of::Exceptions(exceptions) => exceptions.latched(),
        }
    }
}
