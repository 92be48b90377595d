//! Steps of the decision model in a mission, with what was true after each.

use vigil_blocks::Action;
use vigil_missions::exceptions::NOMINAL;
use vigil_missions::learning::Record;
use vigil_pomdp::Pomdp;
use vigil_sensor_sim::{NavigationCondition, Simulation, WayAhead};

use crate::missions::{Cause, PresentFault};

/// A robot that moves away is this much farther from what is in its way, at most, m.
const MOVED_M: f64 = 1.5;

/// Follows a commander's action blocks.
pub(super) struct StepRecorder<'a> {
    model: &'a Pomdp,
    range_m: f64,
    record: Record,
    step_count: u64,
    /// What was last wrong with the way.
    way: Option<&'static str>,
}

impl<'a> StepRecorder<'a> {
    /// Of a model, for a robot that slows down `range_m` before what is in its way.
    pub(super) fn new(model: &'a Pomdp, range_m: f64) -> Self {
        Self {
            range_m,
            model,
            record: Record::default(),
            step_count: 0,
            way: None,
        }
    }

    /// Takes a cycle's action block and the world of that cycle. A step whose observation the
    /// model does not have is left out.
    pub(super) fn take(
        &mut self,
        action: &Action,
        simulation: &Simulation,
        faults: &[PresentFault],
    ) {
        let is_first = self.record.labels.is_empty();
        let is_step =
            std::mem::replace(&mut self.step_count, action.step_count) != action.step_count;
        if !is_first {
            if !is_step || action.step_observation == u32::MAX {
                return;
            }
            self.record.actions.push(action.step_action);
            self.record.observations.push(action.step_observation);
        }
        let label = self.label(simulation, faults);
        self.record.labels.push(label);
    }

    /// What was recorded.
    pub(super) fn finish(self) -> Record {
        self.record
    }

    /// The model's state of what is wrong; `None` for what it does not have.
    fn label(&mut self, simulation: &Simulation, faults: &[PresentFault]) -> Option<u32> {
        let condition = simulation.navigation_condition(self.range_m)?;
        let way = wrong_with_the_way(condition);
        // What a robot has moved away from is still in its way.
        let far = simulation.navigation_condition(self.range_m + MOVED_M)?;
        if way.is_some() || wrong_with_the_way(far).is_none() {
            self.way = way;
        }
        let way = self.way;
        let place = match (condition.is_lost, condition.heads_wrong) {
            (true, _) => Some("LST"),
            (false, true) => Some("WD"),
            (false, false) => None,
        };
        let hardware = faults.first().map(|fault| match fault.cause {
            Cause::Stuck(_) => "STUCK",
            Cause::Encoder(_) => "ENCODER",
            Cause::Unmodelled => "UNKNOWN",
        });
        let wrong: Vec<&str> = [way, place, hardware].into_iter().flatten().collect();
        let name = match wrong.is_empty() {
            true => NOMINAL.to_owned(),
            false => wrong.join("-"),
        };
        let state = self.model.states().iter().position(|of| *of == name);
        state.map(|state| state as u32)
    }
}

fn wrong_with_the_way(condition: NavigationCondition) -> Option<&'static str> {
    match condition.way {
        WayAhead::Filled | WayAhead::Crowded if condition.has_other_way => Some("NNP"),
        WayAhead::Filled => Some("DE"),
        WayAhead::Crowded => Some("CROWD"),
        WayAhead::TooNear => Some("RT"),
        WayAhead::Free | WayAhead::Passable if condition.touches => Some("RT"),
        WayAhead::Passable => Some("PP"),
        WayAhead::Free => None,
    }
}
