//! What the identifier believes: curves, and a status for each fault that may be.

use vigil_blocks::{FaultBelief, FaultSet, MODE_BLIND, MODE_UNKNOWN, SizeKind, mode_word};
use vigil_robot::channel::evidence_name;
use vigil_robot::{Description, FaultTree};
use vigil_setup::Setup;

use super::Outcome;
use crate::container::Container;
use crate::error::FlightError;
use crate::message_times::MessageTimes;
use crate::messages::diagnostics::{Diagnostics, Level, Status};
use crate::messages::header::Header;
use crate::messages::joint_state::JointState;
use crate::pace::Pace;

/// Shortest time between two statuses of one diagnosis, ns.
const STATUS_NS: u64 = 100_000_000;
/// Least probability of a fault that has a status.
const P_SHOWN: f64 = 0.01;
/// Least probabilities of a fault that is a warning, and of one that is an error. Chosen by hand,
/// for the colours of viewers; no decision is made by them.
const P_WARN: f64 = 0.1;
const P_ERROR: f64 = 0.5;

/// Names of the fault tree, and what the robot is called.
pub(crate) struct DiagnosisTranslation {
    tree: FaultTree,
    robot: Description,
    names: Vec<String>,
    pace: Pace,
}

impl DiagnosisTranslation {
    pub(crate) fn new(setup: &Setup) -> Self {
        let nodes = setup.tree.nodes().iter().map(|node| node.name.clone());
        let unknown = mode_word(MODE_UNKNOWN).map(str::to_owned);
        Self {
            tree: setup.tree.clone(),
            robot: setup.robot.clone(),
            names: nodes.chain(unknown).collect(),
            pace: Pace::every_ns(STATUS_NS),
        }
    }

    /// Writes what a belief says.
    pub(crate) fn write(
        &mut self,
        belief: &FaultBelief,
        times: MessageTimes,
        file: &mut Container,
    ) -> Result<Outcome, FlightError> {
        if belief.tree_hash != self.tree.hash() {
            return Ok(Outcome::OtherModels);
        }
        let nodes = belief.p.iter().take(self.tree.nodes().len()).copied();
        let values: Vec<f64> = nodes.chain([belief.p_unknown]).collect();
        let state = JointState::named(times.capture_ns, &self.names, &values);
        file.write("/vigil/belief", times, &state)?;
        if self.pace.is_due(times.log_ns, belief.reported.into()) {
            let overall = self.overall(belief);
            let leaves = self.tree.leaves().filter(|at| belief.p[*at] >= P_SHOWN);
            let leaves = leaves.map(|at| self.leaf(belief, at));
            let statuses: Vec<Status> = [overall].into_iter().chain(leaves).collect();
            let diagnostics = Diagnostics {
                header: Header::at(times.capture_ns),
                hardware: &self.robot.name,
                statuses: &statuses,
            };
            file.write("/diagnostics", times, &diagnostics)?;
        }
        Ok(Outcome::Messages)
    }

    /// The reported mode, why it is that, and the most probable set.
    fn overall(&self, belief: &FaultBelief) -> Status {
        let level = match belief.reported {
            0 => Level::Ok,
            MODE_UNKNOWN => Level::Warn,
            MODE_BLIND => Level::Stale,
            _ => Level::Error,
        };
        let mode = |mode: u32| self.tree.mode_name(mode).to_owned();
        let mut values = vec![
            ("mode", mode(belief.mode)),
            ("p_mode", format!("{:.4}", belief.p_mode)),
            ("p_unknown", format!("{:.4}", belief.p_unknown)),
            ("runner-up", mode(belief.runner_up)),
            ("most probable set", self.set(&belief.sets[0])),
        ];
        values.extend(self.evidence(belief));
        Status {
            level,
            name: "diagnosis".to_owned(),
            message: mode(belief.reported),
            values,
        }
    }

    /// One fault that may be.
    fn leaf(&self, belief: &FaultBelief, at: usize) -> Status {
        let p = belief.p[at];
        let is_reported = belief.reported as usize == at;
        let level = match p {
            _ if is_reported || p >= P_ERROR => Level::Error,
            _ if p >= P_WARN => Level::Warn,
            _ => Level::Ok,
        };
        let size_kind = SizeKind::from_wire(belief.size_kind[at]);
        let size = size_kind.text(belief.size[at], belief.size_sd[at]);
        let mut values = vec![("probability", format!("{p:.4}"))];
        if !size.is_empty() {
            values.push(("size", size.clone()));
        }
        // Evidence is of the most probable mode only.
        if belief.mode as usize == at {
            values.extend(self.evidence(belief));
            let runner_up = self.tree.mode_name(belief.runner_up);
            values.push(("runner-up", runner_up.to_owned()));
        }
        let message = match size.as_str() {
            "" => format!("p {p:.2}"),
            size => format!("p {p:.2}, {size}"),
        };
        Status {
            level,
            name: self.names[at].clone(),
            message,
            values,
        }
    }

    /// The channel that speaks most for the mode, if any does.
    fn evidence(&self, belief: &FaultBelief) -> Option<(&'static str, String)> {
        let places = belief.channel_evidence.iter().enumerate();
        let (place, nat) = places.max_by(|a, b| a.1.total_cmp(b.1))?;
        let name = || evidence_name(&self.robot, place);
        (*nat > 0.0).then(|| ("evidence", format!("{}: {nat:.1} nat", name())))
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
