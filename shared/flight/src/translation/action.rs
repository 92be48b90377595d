//! What the supervisor believes and decides.

use vigil_blocks::Action;
use vigil_robot::Description;
use vigil_setup::Setup;

use super::Outcome;
use crate::message_times::MessageTimes;
use crate::messages::joint_state::JointState;
use crate::messages::text::Text;
use crate::pace::Pace;
use crate::sink::Sink;
use crate::topics;

/// Longest time after which the action is written again, ns.
const REPEAT_NS: u64 = 1_000_000_000;

/// Names of the decision model.
pub(crate) struct ActionTranslation {
    model_hash: u64,
    states: Vec<String>,
    actions: Vec<String>,
    robot: Description,
    pace: Pace,
}

impl ActionTranslation {
    pub(crate) fn new(setup: &Setup) -> Self {
        Self {
            model_hash: setup.decision.hash(),
            states: setup.decision.states().to_vec(),
            actions: setup.decision.actions().to_vec(),
            robot: setup.robot.clone(),
            pace: Pace::every_ns(REPEAT_NS),
        }
    }

    /// Writes what a decision says.
    pub(crate) fn write<S: Sink>(
        &mut self,
        action: &Action,
        times: MessageTimes,
        sink: &mut S,
    ) -> Result<Outcome, S::Error> {
        if action.model_hash != self.model_hash {
            return Ok(Outcome::OtherModels);
        }
        let states = self.states.len().min(action.belief.len());
        let (names, values) = (&self.states[..states], &action.belief[..states]);
        let state = JointState::named(times.capture_ns, names, values);
        sink.write(&topics::DECISION, times, &state)?;
        if self.pace.is_due(times.log_ns, action.decision_seq) {
            let name = self.actions.get(action.action as usize);
            let name = name.map_or("?", String::as_str);
            let text = self.robot.action_text(name, action.answered());
            sink.write(&topics::ACTION, times, &Text { data: &text })?;
        }
        Ok(Outcome::Messages)
    }
}
