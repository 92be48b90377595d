//! What the identifier believes: curves, and what it names now.

use vigil_blocks::{FaultBelief, FaultSet, MODE_BLIND, MODE_UNKNOWN, mode_word};
use vigil_robot::{Description, FaultTree};
use vigil_setup::Setup;

use super::Outcome;
use super::explanation::Explanation;
use crate::message_times::MessageTimes;
use crate::messages::diagnostics::{Level, Status};
use crate::messages::joint_state::JointState;
use crate::sink::Sink;
use crate::topics;

/// Name of the status.
const NAME: &str = "diagnosis";

/// Names of the fault tree, and the newest belief.
pub(crate) struct DiagnosisTranslation {
    tree: FaultTree,
    robot: Description,
    names: Vec<String>,
    newest: Option<Box<FaultBelief>>,
}

impl DiagnosisTranslation {
    pub(crate) fn new(setup: &Setup) -> Self {
        let nodes = setup.tree.nodes().iter().map(|node| node.name.clone());
        let unknown = mode_word(MODE_UNKNOWN).map(str::to_owned);
        Self {
            tree: setup.tree.clone(),
            robot: setup.robot.clone(),
            names: nodes.chain(unknown).collect(),
            newest: None,
        }
    }

    /// Writes what a belief says.
    pub(crate) fn write<S: Sink>(
        &mut self,
        belief: &FaultBelief,
        times: MessageTimes,
        sink: &mut S,
    ) -> Result<Outcome, S::Error> {
        if belief.tree_hash != self.tree.hash() {
            return Ok(Outcome::OtherModels);
        }
        let nodes = belief.p.iter().take(self.tree.nodes().len()).copied();
        let values: Vec<f64> = nodes.chain([belief.p_unknown]).collect();
        let state = JointState::named(times.capture_ns, &self.names, &values);
        sink.write(&topics::BELIEF, times, &state)?;
        self.newest = Some(Box::new(*belief));
        Ok(Outcome::Messages)
    }

    /// Nothing is heard any more.
    pub(crate) fn forget(&mut self) {
        self.newest = None;
    }

    /// What the newest belief names.
    pub(crate) fn status(&self) -> Status {
        let newest = self.newest.as_deref();
        let unknown = || Status::stale(NAME, "nothing is heard");
        newest.map_or_else(unknown, |belief| self.named(belief))
    }

    /// The reported mode, why it is that, and the most probable set.
    fn named(&self, belief: &FaultBelief) -> Status {
        let level = match belief.reported {
            0 => Level::Ok,
            MODE_UNKNOWN => Level::Warn,
            MODE_BLIND => Level::Stale,
            _ => Level::Error,
        };
        let mode = |mode: u32| self.tree.mode_name(mode).to_owned();
        let mut values = vec![
            ("mode", mode(belief.mode)),
            ("probability", format!("{:.4}", belief.p_mode)),
            ("p_unknown", format!("{:.4}", belief.p_unknown)),
            ("most probable set", self.set(&belief.sets[0])),
        ];
        values.extend(self.explanation(belief).values(&self.robot));
        Status {
            level,
            name: NAME.to_owned(),
            message: mode(belief.reported),
            values,
        }
    }

    /// Of the most probable mode; one that is no node has no size.
    fn explanation(&self, belief: &FaultBelief) -> Explanation<'_> {
        let at = belief.mode as usize;
        let places = belief.channel_evidence.iter().copied().enumerate();
        let most = places.max_by(|a, b| a.1.total_cmp(&b.1));
        let (channel, evidence) = most.unwrap_or_default();
        Explanation {
            size_kind: belief.size_kind.get(at).copied().unwrap_or_default(),
            size: belief.size.get(at).copied().unwrap_or_default(),
            size_sd: belief.size_sd.get(at).copied().unwrap_or_default(),
            evidence,
            channel,
            runner_up: self.tree.mode_name(belief.runner_up),
        }
    }

    fn set(&self, set: &FaultSet) -> String {
        let nodes = self.tree.nodes().iter().enumerate();
        let inside = nodes.filter(|(at, _)| set.leaves >> at & 1 == 1);
        let names: Vec<&str> = inside.map(|(_, node)| node.name.as_str()).collect();
        let names = match names.is_empty() {
            true => self.tree.mode_name(0).to_owned(),
            false => names.join("+"),
        };
        format!("{names} ({:.4})", set.p)
    }
}
