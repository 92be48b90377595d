//! Rules by fault.

use vigil_blocks::{FAULT_NODES, FaultSource, MODE_UNKNOWN, Severity};
use vigil_robot::FaultTree;

use super::settings::{FaultLifeSettings, FaultRule};

/// Services, in the order of the data, as rules name them.
pub(super) const SERVICES: [&str; 4] = ["sensor-sim", "detector", "identifier", "supervisor"];

/// A rule about a fault that does not exist.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("faults.rules.{name}: there is no such fault; there are {known}")]
pub struct FaultRuleError {
    name: String,
    known: String,
}

/// What holds for a fault.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Rule {
    pub debounce_ns: u64,
    pub clear_ns: u64,
    pub latches: bool,
    pub severity: Severity,
}

/// The rule of each fault.
#[derive(Debug, Clone)]
pub(super) struct FaultRules {
    nodes: [Rule; FAULT_NODES],
    unknown: Rule,
    input: Rule,
    services: [Rule; SERVICES.len()],
}

impl FaultRules {
    pub(super) fn new(
        settings: &FaultLifeSettings,
        tree: &FaultTree,
    ) -> Result<Self, FaultRuleError> {
        let plain = Rule {
            debounce_ns: ns(settings.debounce_s),
            clear_ns: ns(settings.clear_s),
            latches: settings.latch,
            severity: Severity::Fault,
        };
        let mut rules = Self {
            nodes: [plain; FAULT_NODES],
            unknown: plain,
            // That nothing is seen is no fault of the robot, and is over when it sees again.
            input: Rule {
                severity: Severity::Warning,
                latches: false,
                ..plain
            },
            services: [Rule {
                severity: Severity::Warning,
                ..plain
            }; SERVICES.len()],
        };
        for (name, own) in &settings.rules {
            let service = SERVICES.iter().position(|it| it == name);
            let place = match (name.as_str(), tree.index(name), service) {
                ("UNKNOWN", ..) => &mut rules.unknown,
                ("INPUT", ..) => &mut rules.input,
                (_, Some(node), _) if node > 0 => &mut rules.nodes[node],
                (_, _, Some(service)) => &mut rules.services[service],
                _ => return Err(unknown(name, tree)),
            };
            *place = place.changed(own);
        }
        Ok(rules)
    }

    /// The rule of a fault.
    pub(super) fn of_fault(&self, source: u32, what: u32) -> Rule {
        let at = what as usize;
        match FaultSource::from_repr(source) {
            Some(FaultSource::Input) => self.input,
            Some(FaultSource::Service) => self.services.get(at).copied().unwrap_or(self.input),
            _ if what == MODE_UNKNOWN => self.unknown,
            _ => self.nodes.get(at).copied().unwrap_or(self.unknown),
        }
    }
}

impl Rule {
    /// The same but for what `own` says.
    fn changed(self, own: &FaultRule) -> Self {
        Self {
            debounce_ns: own.debounce_s.map_or(self.debounce_ns, ns),
            clear_ns: own.clear_s.map_or(self.clear_ns, ns),
            latches: own.latch.unwrap_or(self.latches),
            severity: own.severity.map_or(self.severity, Severity::from),
        }
    }
}

/// Seconds in ns.
fn ns(seconds: f64) -> u64 {
    (seconds * 1e9) as u64
}

fn unknown(name: &str, tree: &FaultTree) -> FaultRuleError {
    let nodes = tree.nodes().iter().skip(1).map(|node| node.name.as_str());
    let others = ["UNKNOWN", "INPUT"].into_iter().chain(SERVICES);
    let known: Vec<&str> = nodes.chain(others).collect();
    FaultRuleError {
        name: name.to_owned(),
        known: known.join(", "),
    }
}
