//! Names of faults, as rules, orders and reports have them.

use vigil_blocks::FaultSource;
use vigil_cycle::topic::ServiceName;
use vigil_robot::FaultTree;

/// The name of a fault: a node of the fault tree, `UNKNOWN`, `INPUT`, or a service. `source` and
/// `what` are those of a [`vigil_blocks::FaultRecord`].
#[must_use]
pub fn fault_name(tree: &FaultTree, source: u32, what: u32) -> &str {
    match FaultSource::from_repr(source) {
        Some(FaultSource::Robot) => tree.mode_name(what),
        Some(FaultSource::Input) => "INPUT",
        Some(FaultSource::Service) => {
            let service = ServiceName::ALL.get(what as usize);
            service.map_or("?", |it| it.as_str())
        }
        None => "?",
    }
}
