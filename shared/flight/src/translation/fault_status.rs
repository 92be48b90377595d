//! One fault as a status, by a name and a code that stay.

use vigil_blocks::{FaultRecord, FaultSource, FaultState, Severity};
use vigil_robot::{Description, FaultTree};
use vigil_setup::{Setup, fault_name};
use vigil_timeline::WallClock;

use super::explanation::Explanation;
use crate::messages::diagnostics::{Level, Status};

/// Names of faults, and of what is done about them.
pub(crate) struct FaultNames {
    tree: FaultTree,
    robot: Description,
    actions: Vec<String>,
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

/// For programs: `VIGIL_ROBOT_RM_STUCK`.
fn code(source: &str, name: &str) -> String {
    let plain = |letter: char| match letter.is_ascii_alphanumeric() {
        true => letter.to_ascii_uppercase(),
        false => '_',
    };
    format!("VIGIL_{source}_{name}")
        .chars()
        .map(plain)
        .collect()
}

impl FaultNames {
    pub(crate) fn new(setup: &Setup) -> Self {
        Self {
            tree: setup.tree.clone(),
            robot: setup.robot.clone(),
            actions: setup.decision.actions().to_vec(),
        }
    }

    /// Hash of the tree that the names are of.
    pub(crate) fn tree_hash(&self) -> u64 {
        self.tree.hash()
    }

    /// What is known of a fault.
    pub(crate) fn status(&self, record: &FaultRecord, clock: &WallClock) -> Status {
        let name = fault_name(&self.tree, record.source, record.what);
        let state = record.state().map_or("?", FaultState::name);
        let severity = Severity::from_repr(record.severity).map_or("?", Severity::name);
        let source = FaultSource::from_repr(record.source);
        let source_name = source.map_or("?", FaultSource::name);
        let action = self.actions.get(record.action as usize);
        let unix_s = |t_ns: u64| format!("{:.3}", clock.unix_ns(t_ns) as f64 * 1e-9);
        let mut values = vec![
            ("code", code(source_name, name)),
            ("state", state.to_owned()),
            ("severity", severity.to_owned()),
            ("source", source_name.to_owned()),
            ("number", record.number.to_string()),
            ("count", record.count.to_string()),
            ("probability", format!("{:.4}", record.p)),
            ("first, s since 1970", unix_s(record.first_ns)),
            ("last, s since 1970", unix_s(record.last_ns)),
            ("action", action.map_or("?", String::as_str).to_owned()),
        ];
        if source == Some(FaultSource::Robot) {
            let explanation = Explanation {
                size_kind: record.size_kind,
                size: record.size,
                size_sd: record.size_sd,
                evidence: record.evidence,
                channel: record.evidence_channel as usize,
                runner_up: self.tree.mode_name(record.runner_up),
            };
            values.extend(explanation.values(&self.robot));
        }
        Status {
            level: level(record),
            name: name.to_owned(),
            message: format!("{state} ({severity}), p {:.2}", record.p),
            values,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::code;

    #[test]
    fn codes_are_words_in_capitals() {
        assert_eq!(code("robot", "RM_STUCK"), "VIGIL_ROBOT_RM_STUCK");
        assert_eq!(code("service", "sensor-sim"), "VIGIL_SERVICE_SENSOR_SIM");
    }
}
