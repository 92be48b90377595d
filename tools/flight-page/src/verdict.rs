//! What was wrong, since when, how sure that is, what was done, and how it stands: in words.

use vigil_blocks::{FaultState, OverallState};

/// Actions that are named.
const ACTIONS_MAX: usize = 4;

/// What was wrong.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum FaultKind {
    /// A part of the robot that the fault tree names.
    Part,
    /// Something that no fault of the tree explains.
    Unknown,
    /// What the graph was sent.
    Input,
    /// A service of the graph.
    Service,
}

/// A fault that was present.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct FaultFinding {
    pub(crate) kind: FaultKind,
    pub(crate) name: String,
    /// When it began, s; below 0 before the recording.
    pub(crate) since_s: f64,
    /// The same by the calendar.
    pub(crate) clock: String,
    /// Until when it was present, s; `None` if it is at the end.
    pub(crate) until_s: Option<f64>,
    pub(crate) p: f64,
    /// Its state at the end; `None` once it is over.
    pub(crate) state: Option<FaultState>,
}

/// How a file ends.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum FileEnd {
    Whole,
    Cut,
    Damaged,
}

/// What a recording says.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Findings {
    pub(crate) duration_s: f64,
    /// False if nothing of detector and supervisor was recorded.
    pub(crate) is_diagnosed: bool,
    pub(crate) faults: Vec<FaultFinding>,
    /// When alarms rose, s.
    pub(crate) alarms_s: Vec<f64>,
    /// Actions from the first fault on, each with its beginning, s.
    pub(crate) actions: Vec<(String, f64)>,
    pub(crate) last_action: Option<String>,
    pub(crate) overall: Option<OverallState>,
    pub(crate) end: FileEnd,
}

impl FaultFinding {
    fn time(&self) -> String {
        let begin = match self.since_s < 0.0 {
            true => "since before the recording began".to_owned(),
            false => format!("since {:.1} s ({} UTC)", self.since_s, self.clock),
        };
        match self.until_s {
            Some(until_s) => format!("{begin}, until {until_s:.1} s"),
            None => begin,
        }
    }

    fn words(&self) -> String {
        let (name, time, p) = (&self.name, self.time(), self.p);
        match self.kind {
            FaultKind::Part => format!("{name} {time}, with a probability of up to {p:.3}"),
            FaultKind::Unknown => format!(
                "something that no fault of the tree explains ({name}) {time}, with a probability \
                 of up to {p:.3}"
            ),
            FaultKind::Input => format!("the input ({name}) {time}"),
            FaultKind::Service => format!("the service {name} {time}"),
        }
    }

    fn end(&self) -> String {
        let state = self.state.map_or("over", FaultState::name);
        format!("{} is {state}", self.name)
    }
}

impl Findings {
    /// The sentences.
    pub(crate) fn verdict(&self) -> String {
        let mut sentences = vec![self.wrong()];
        if !self.faults.is_empty() {
            sentences.extend(self.done());
        }
        sentences.extend(self.ending());
        let duration_s = self.duration_s;
        match self.end {
            FileEnd::Whole => {}
            FileEnd::Cut => sentences.push(format!(
                "The file is cut short: what came after {duration_s:.1} s is not known."
            )),
            FileEnd::Damaged => sentences.push(format!(
                "The file is damaged: what came after {duration_s:.1} s cannot be read."
            )),
        }
        sentences.join(" ")
    }

    fn wrong(&self) -> String {
        let duration_s = self.duration_s;
        let faults: Vec<String> = self.faults.iter().map(FaultFinding::words).collect();
        match (&faults[..], &self.alarms_s[..]) {
            _ if !self.is_diagnosed => "The recording holds no diagnosis: it does not say whether \
                                        anything was wrong."
                .to_owned(),
            ([], []) if self.overall.is_none() => {
                format!("No alarm in {duration_s:.1} s; which faults there were was not recorded.")
            }
            ([], []) => {
                format!("Nothing was wrong: no alarm and no fault in {duration_s:.1} s.")
            }
            ([], [alarm_s]) => {
                format!("An alarm rose at {alarm_s:.1} s, but no fault became active.")
            }
            ([], [first_s, ..]) => {
                let count = self.alarms_s.len();
                format!("{count} alarms rose, first at {first_s:.1} s, but no fault became active.")
            }
            ([fault], _) => format!("This was wrong: {fault}."),
            (faults, _) => {
                format!(
                    "{} faults were present: {}.",
                    faults.len(),
                    faults.join("; ")
                )
            }
        }
    }

    fn done(&self) -> Option<String> {
        let named = self.actions.iter().take(ACTIONS_MAX);
        let named = named.map(|(name, since_s)| format!("{name} from {since_s:.1} s"));
        let named: Vec<String> = named.collect();
        let further = self.actions.len().saturating_sub(ACTIONS_MAX);
        let further = match further {
            0 => String::new(),
            count => format!(" and {count} further changes"),
        };
        let named = named.join(", ");
        (!named.is_empty()).then(|| format!("What was done: {named}{further}."))
    }

    fn ending(&self) -> Option<String> {
        let faults: Vec<String> = self.faults.iter().map(FaultFinding::end).collect();
        let action = self.last_action.iter();
        let action = action.map(|name| format!("the action is {name}"));
        let overall = self.overall.iter();
        let overall = overall.map(|state| format!("the overall state is {}", state.name()));
        let parts: Vec<String> = faults.into_iter().chain(action).chain(overall).collect();
        (!parts.is_empty()).then(|| format!("At the end {}.", parts.join(", ")))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn healthy() -> Findings {
        Findings {
            duration_s: 62.0,
            is_diagnosed: true,
            faults: Vec::new(),
            alarms_s: Vec::new(),
            actions: Vec::new(),
            last_action: Some("go_on".into()),
            overall: Some(OverallState::Ok),
            end: FileEnd::Whole,
        }
    }

    fn fault(kind: FaultKind, name: &str) -> FaultFinding {
        FaultFinding {
            kind,
            name: name.into(),
            since_s: 8.6,
            clock: "18:57:11".into(),
            until_s: None,
            p: 0.998,
            state: Some(FaultState::Active),
        }
    }

    #[test]
    fn of_a_healthy_robot_nothing_was_wrong() {
        let wanted = "Nothing was wrong: no alarm and no fault in 62.0 s. At the end the action is \
                      go_on, the overall state is ok.";
        assert_eq!(healthy().verdict(), wanted);
    }

    #[test]
    fn one_fault_has_its_name_time_probability_actions_and_end() {
        let findings = Findings {
            faults: vec![fault(FaultKind::Part, "RM_STUCK")],
            alarms_s: vec![8.5],
            actions: vec![("stop".into(), 8.6), ("compensate:RM".into(), 9.1)],
            last_action: Some("compensate:RM".into()),
            overall: Some(OverallState::Fault),
            ..healthy()
        };
        let wanted = "This was wrong: RM_STUCK since 8.6 s (18:57:11 UTC), with a probability of \
                      up to 0.998. What was done: stop from 8.6 s, compensate:RM from 9.1 s. At \
                      the end RM_STUCK is active, the action is compensate:RM, the overall state \
                      is fault.";
        assert_eq!(findings.verdict(), wanted);
    }

    #[test]
    fn an_unknown_fault_and_several_are_told_as_such() {
        let unknown = Findings {
            faults: vec![fault(FaultKind::Unknown, "UNKNOWN")],
            ..healthy()
        };
        let text = unknown.verdict();
        assert!(
            text.contains("something that no fault of the tree explains (UNKNOWN)"),
            "{text}"
        );
        let over = FaultFinding {
            since_s: -1.0,
            until_s: Some(12.0),
            state: None,
            ..fault(FaultKind::Service, "detector")
        };
        let several = Findings {
            faults: vec![fault(FaultKind::Part, "RM_STUCK"), over],
            ..healthy()
        };
        let text = several.verdict();
        let wanted = "2 faults were present: RM_STUCK since 8.6 s (18:57:11 UTC), with a \
                      probability of up to 0.998; the service detector since before the recording \
                      began, until 12.0 s.";
        assert!(text.starts_with(wanted), "{text}");
        assert!(
            text.contains("At the end RM_STUCK is active, detector is over,"),
            "{text}"
        );
    }

    #[test]
    fn a_file_without_an_end_or_a_diagnosis_says_so() {
        let cut = Findings {
            end: FileEnd::Cut,
            alarms_s: vec![3.0],
            ..healthy()
        };
        let text = cut.verdict();
        assert!(text.starts_with("An alarm rose at 3.0 s, but no fault became active."));
        assert!(text.ends_with("The file is cut short: what came after 62.0 s is not known."));
        let empty = Findings {
            is_diagnosed: false,
            last_action: None,
            overall: None,
            ..healthy()
        };
        assert!(
            empty
                .verdict()
                .starts_with("The recording holds no diagnosis")
        );
    }
}
