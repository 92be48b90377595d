//! Gyro and currents beside the identifier's ring.

use std::collections::VecDeque;

use vigil_blocks::FaultBelief;
use vigil_checkpoint::Checkpoint;
use vigil_robot::learned::further_watch::Residuals;
use vigil_robot::learned::{Further, Healthy, Model, Observation};
use vigil_robot::{Description, Suspects};

use crate::identify::further::{FurtherFilter, Fusion};
use crate::identify::leaf_map::LeafMap;
use crate::identify::models::Models;
use crate::identify::settings::{IdentifierFilter, Settings};
use crate::sensors::Sensors;

/// The filter, and what each observation of the identifier's ring holds.
#[derive(Debug, Clone, Checkpoint)]
pub struct FurtherStage {
    #[checkpoint(fixed)]
    model: Model,
    #[checkpoint(fixed)]
    robot: Description,
    filter: FurtherFilter,
    ring: VecDeque<(Further, Option<Residuals>)>,
    capacity: usize,
}

impl FurtherStage {
    /// A filter over the leaves of a tree, beside a ring of so many observations; None if these
    /// channels take no part, or the model knows none of them.
    #[must_use]
    pub fn new(
        models: &Models<'_>,
        leaves: &LeafMap,
        sensors: Sensors,
        settings: &Settings,
        capacity: usize,
    ) -> Option<Self> {
        let (model, robot, p_unknown) = (models.model, models.robot, settings.p_unknown);
        let holds_sets = settings.filter == IdentifierFilter::MultipleHypothesis;
        if sensors != Sensors::All || !holds_sets {
            return None;
        }
        Some(Self {
            filter: FurtherFilter::new(model, robot, leaves, p_unknown)?,
            model: model.clone(),
            robot: robot.clone(),
            ring: VecDeque::with_capacity(capacity),
            capacity,
        })
    }

    /// A new run begins.
    pub fn begin_run(&mut self) {
        self.filter.begin_run(&self.robot);
        self.ring.clear();
    }

    /// Starts from a whole robot. What was learned on the way is forgotten unless that was one.
    pub fn restart(&mut self, was_whole: bool) {
        match was_whole {
            true => self.filter.restart(),
            false => self.filter.begin_run(&self.robot),
        }
    }

    /// Adds an observation to the ring; the oldest gives way. What is believed of a healthy robot
    /// follows it but for what `suspects` read.
    pub fn keep(
        &mut self,
        observation: &Observation,
        further: &Further,
        healthy: &Healthy,
        suspects: Suspects,
    ) {
        let (model, robot) = (&self.model, &self.robot);
        let seen = (observation, further);
        let residuals = self.filter.look(model, robot, seen, healthy, suspects);
        if self.ring.len() == self.capacity {
            self.ring.pop_front();
        }
        self.ring.push_back((*further, residuals));
    }

    /// Takes the observation at a place of the ring.
    pub fn step(&mut self, place: usize, observation: &Observation) {
        if let Some((further, Some(residuals))) = self.ring.get(place) {
            self.filter.step(observation, further, residuals);
        }
    }

    /// How probabilities of sets of faults change.
    #[must_use]
    pub fn fusion(&self) -> Fusion {
        self.filter.fusion()
    }

    /// Writes in which way the leaves of these channels are broken, and how large the faults are.
    pub fn sizes(&self, belief: &mut FaultBelief) {
        self.filter.sizes(belief);
    }
}
