//! The life of faults: the graph as a whole, and each fault.

use std::collections::BTreeSet;

use vigil_blocks::{Faults, OverallState};
use vigil_setup::Setup;

use super::Outcome;
use super::fault_status::FaultNames;
use crate::message_times::MessageTimes;
use crate::messages::diagnostics::{Diagnostics, Level, Status};
use crate::messages::header::Header;
use crate::pace::Pace;
use crate::sink::Sink;
use crate::topics;

/// Shortest time between two messages that say the same, ns.
const REPEAT_NS: u64 = 500_000_000;

/// Names of faults, and those that were told last.
pub(crate) struct FaultsTranslation {
    graph: String,
    names: FaultNames,
    told: BTreeSet<String>,
    pace: Pace,
}

impl FaultsTranslation {
    pub(crate) fn new(setup: &Setup) -> Self {
        Self {
            graph: setup.file.graph.name.clone(),
            names: FaultNames::new(setup),
            told: BTreeSet::new(),
            pace: Pace::every_ns(REPEAT_NS),
        }
    }

    /// The same after a new start of the graph: what is told no longer is still over.
    pub(crate) fn restarted(self, setup: &Setup) -> Self {
        Self {
            told: self.told,
            ..Self::new(setup)
        }
    }

    /// Writes what is known of faults, and `diagnosis` besides. A fault that is kept no longer is
    /// told to be over, once.
    pub(crate) fn write<S: Sink>(
        &mut self,
        faults: &Faults,
        diagnosis: impl FnOnce() -> Status,
        times: MessageTimes,
        sink: &mut S,
    ) -> Result<Outcome, S::Error> {
        if faults.tree_hash != self.names.tree_hash() {
            return Ok(Outcome::OtherModels);
        }
        if !self.pace.is_due(times.log_ns, faults.revision) {
            return Ok(Outcome::Messages);
        }
        let mut statuses = vec![overall(faults)];
        let mut records: Vec<_> = faults.kept().collect();
        // Of one name, what was last comes last: readers keep that.
        records.sort_by_key(|record| record.number);
        let clock = *sink.clock();
        statuses.extend(records.iter().map(|of| self.names.status(of, &clock)));
        let told = statuses[1..].iter().map(|status| status.name.clone());
        let before = std::mem::replace(&mut self.told, told.collect());
        let over = before.difference(&self.told).map(|name| Status {
            level: Level::Ok,
            name: name.clone(),
            message: "over, and kept no longer".to_owned(),
            values: Vec::new(),
        });
        statuses.extend(over);
        self.send(statuses, diagnosis(), times, sink)?;
        Ok(Outcome::Messages)
    }

    /// Writes that nothing of it is known any more.
    pub(crate) fn write_stale<S: Sink>(
        &self,
        why: &str,
        diagnosis: Status,
        times: MessageTimes,
        sink: &mut S,
    ) -> Result<(), S::Error> {
        let faults = self.told.iter().map(|name| Status::stale(name, why));
        let statuses = [Status::stale("", why)].into_iter().chain(faults);
        self.send(statuses.collect(), diagnosis, times, sink)
    }

    fn send<S: Sink>(
        &self,
        mut statuses: Vec<Status>,
        diagnosis: Status,
        times: MessageTimes,
        sink: &mut S,
    ) -> Result<(), S::Error> {
        sink.write(&topics::FAULTS, times, &self.array(&statuses, times))?;
        statuses.insert(1, diagnosis);
        sink.write(&topics::DIAGNOSTICS, times, &self.array(&statuses, times))
    }

    fn array<'a>(&'a self, statuses: &'a [Status], times: MessageTimes) -> Diagnostics<'a> {
        Diagnostics {
            header: Header::at(times.capture_ns),
            graph: &self.graph,
            statuses,
        }
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
    let state = state.map_or("?", OverallState::name);
    Status {
        level,
        name: String::new(),
        message: state.to_owned(),
        values: vec![
            ("state", state.to_owned()),
            ("faults", faults.fault_count.to_string()),
            ("dropped", faults.dropped_count.to_string()),
        ],
    }
}
