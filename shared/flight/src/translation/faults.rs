//! The life of faults.

use vigil_blocks::{
    FaultRecord, FaultSource, FaultState, Faults, OverallState, Severity, SizeKind,
};
use vigil_robot::channel::evidence_name;
use vigil_robot::{Description, FaultTree};
use vigil_setup::{Setup, fault_name};

use super::Outcome;
use crate::container::Container;
use crate::error::FlightError;
use crate::message_times::MessageTimes;
use crate::messages::diagnostics::{Diagnostics, Level, Status};
use crate::messages::header::Header;
use crate::pace::Pace;

/// Shortest time between two messages that say the same, ns.
const REPEAT_NS: u64 = 500_000_000;

/// Names of faults, and of what is done about them.
pub(crate) struct FaultsTranslation {
    tree: FaultTree,
    robot: Description,
    actions: Vec<String>,
    pace: Pace,
}

/// How grave a fault is for viewers: one that is over, or only suspected, is no error.
fn level(record: &FaultRecord) -> Level {
    let is_grave = record.severity == Severity::Fault as u32;
    match record.state() {
        Some(FaultState::Active | FaultState::Acknowledged) if is_grave => Level::Error,
        Some(FaultState::Cleared) => Level::Ok,
        Some(_) => Level::Warn,
        None => Level::Stale,
    }
}

impl FaultsTranslation {
    pub(crate) fn new(setup: &Setup) -> Self {
        Self {
            tree: setup.tree.clone(),
            robot: setup.robot.clone(),
            actions: setup.decision.actions().to_vec(),
            pace: Pace::every_ns(REPEAT_NS),
        }
    }

    /// Writes what is known of faults.
    pub(crate) fn write(
        &mut self,
        faults: &Faults,
        times: MessageTimes,
        file: &mut Container,
    ) -> Result<Outcome, FlightError> {
        if faults.tree_hash != self.tree.hash() {
            return Ok(Outcome::OtherModels);
        }
        if self.pace.is_due(times.log_ns, faults.revision) {
            let overall = overall(faults);
            let records = faults.kept().map(|record| self.status(record));
            let statuses: Vec<Status> = [overall].into_iter().chain(records).collect();
            let diagnostics = Diagnostics {
                header: Header::at(times.capture_ns),
                hardware: &self.robot.name,
                statuses: &statuses,
            };
            file.write("/vigil/faults", times, &diagnostics)?;
        }
        Ok(Outcome::Messages)
    }

    fn status(&self, record: &FaultRecord) -> Status {
        let state = record.state().map_or("?", FaultState::name);
        let severity = Severity::from_repr(record.severity).map_or("?", Severity::name);
        let source = FaultSource::from_repr(record.source);
        let action = self.actions.get(record.action as usize);
        let mut values = vec![
            ("number", record.number.to_string()),
            ("source", source.map_or("?", FaultSource::name).to_owned()),
            ("state", state.to_owned()),
            ("severity", severity.to_owned()),
            ("count", record.count.to_string()),
            ("probability", format!("{:.4}", record.p)),
            ("action", action.map_or("?", String::as_str).to_owned()),
        ];
        if source == Some(FaultSource::Robot) {
            values.extend(self.explanation(record));
        }
        Status {
            level: level(record),
            name: fault_name(&self.tree, record.source, record.what).to_owned(),
            message: format!("{state} ({severity}), p {:.2}", record.p),
            values,
        }
    }

    /// Size of a fault of the robot, and why it is that one.
    fn explanation(&self, record: &FaultRecord) -> Vec<(&'static str, String)> {
        let size = SizeKind::from_wire(record.size_kind).text(record.size, record.size_sd);
        let mut values = Vec::new();
        if !size.is_empty() {
            values.push(("size", size));
        }
        if record.evidence > 0.0 {
            let channel = evidence_name(&self.robot, record.evidence_channel as usize);
            values.push(("evidence", format!("{channel}: {:.1} nat", record.evidence)));
            let runner_up = self.tree.mode_name(record.runner_up);
            values.push(("runner-up", runner_up.to_owned()));
        }
        values
    }
}

/// Robot and graph in one word.
fn overall(faults: &Faults) -> Status {
    let state = OverallState::from_repr(faults.overall);
    let level = match state {
        Some(OverallState::Ok) => Level::Ok,
        Some(OverallState::Degraded) => Level::Warn,
        Some(OverallState::Fault | OverallState::SafeStop) => Level::Error,
        Some(OverallState::Stale) | None => Level::Stale,
    };
    Status {
        level,
        name: "overall".to_owned(),
        message: state.map_or("?", OverallState::name).to_owned(),
        values: vec![
            ("faults", faults.fault_count.to_string()),
            ("dropped", faults.dropped_count.to_string()),
        ],
    }
}
