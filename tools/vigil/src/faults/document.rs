//! Faults with their names, for programs.

use std::time::{SystemTime, UNIX_EPOCH};

use schemars::JsonSchema;
use serde::Serialize;
use vigil_blocks::{
    FaultRecord, FaultSource, FaultState, Faults, OverallState, Severity, SizeKind,
};
use vigil_cycle::{Clock, Monotonic};
use vigil_robot::channel::{channels, evidence_name};
use vigil_setup::{Setup, fault_name};

/// The faults of a graph.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct Document {
    /// Version of this document.
    schema_version: u32,
    /// Name of the graph.
    graph: String,
    /// In one word.
    pub overall: &'static str,
    /// Those that are kept; the newest change first.
    pub faults: Vec<NamedFault>,
    /// What is present beside them, and has no place.
    pub dropped: u32,
    #[serde(skip)]
    revision: (u64, u64),
}

/// A fault with its names. Times are seconds ago, and of the day as seconds since 1970.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct NamedFault {
    /// Counts the graph's faults, from 1.
    pub number: u64,
    /// Its name.
    pub name: String,
    /// What it is a fault of: `robot`, `input`, `service`.
    pub source: &'static str,
    /// Where it is in its life.
    pub state: &'static str,
    /// `fault` or `warning`.
    pub severity: &'static str,
    /// How often it became active.
    pub count: u32,
    /// When it was present first, since 1970.
    pub first_unix_s: f64,
    /// When it was present last, since 1970.
    pub last_unix_s: f64,
    /// When its state changed, since 1970.
    pub changed_unix_s: f64,
    /// How long ago it was present first.
    pub first_ago_s: f64,
    /// How long ago its state changed.
    pub changed_ago_s: f64,
    /// Its probability when it was present last.
    pub p: f64,
    /// How much is broken.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub size: Option<FaultSize>,
    /// What speaks most for it, against what, by how many nat.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub evidence: Option<NamedEvidence>,
    /// What was done about it last.
    pub action: String,
    /// What was measured when it began.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub freeze_frame: Option<FreezeFrame>,
}

#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct FaultSize {
    /// In which way it is broken.
    pub way: &'static str,
    /// In `unit`; both absent for a way that has no size.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub value: Option<f64>,
    /// Its standard deviation, in `unit`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub sd: Option<f64>,
    /// The unit.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub unit: Option<&'static str>,
    /// All of it in words.
    #[serde(skip)]
    pub text: String,
}

#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct NamedEvidence {
    /// The channel that says most.
    pub channel: String,
    /// The fault that would be next.
    pub against: String,
    /// By how much, as a logarithm of likelihoods.
    pub nat: f64,
}

#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct FreezeFrame {
    /// Capture time, ns of the publisher's clock.
    pub t_capture_ns: u64,
    /// The measured channels.
    pub channels: Vec<NamedValue>,
    /// The command, as far as it was known.
    pub command: Vec<NamedValue>,
}

#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct NamedValue {
    /// Name of the channel, or of the command's axis.
    pub name: String,
    /// In `unit`.
    pub value: f64,
    /// The unit; empty if it has none.
    pub unit: String,
}

/// An instant of `CLOCK_MONOTONIC` on the clock of the wall.
#[derive(Debug, Clone, Copy)]
pub struct Now {
    pub monotonic_ns: u64,
    pub unix_s: f64,
}

impl Now {
    pub fn new() -> Self {
        let since = SystemTime::now().duration_since(UNIX_EPOCH);
        Self {
            monotonic_ns: Monotonic.now_ns(),
            unix_s: since.map_or(0.0, |it| it.as_secs_f64()),
        }
    }

    fn ago_s(&self, at_ns: u64) -> f64 {
        rounded(self.monotonic_ns.saturating_sub(at_ns) as f64 * 1e-9)
    }

    fn unix_s(&self, at_ns: u64) -> f64 {
        rounded(self.unix_s - self.monotonic_ns.saturating_sub(at_ns) as f64 * 1e-9)
    }
}

/// To a millisecond.
fn rounded(seconds: f64) -> f64 {
    (seconds * 1e3).round() * 1e-3
}

impl Document {
    /// Name of the graph.
    pub fn graph(&self) -> &str {
        &self.graph
    }

    /// A block with the names that a configuration gives.
    pub fn new(block: &Faults, setup: &Setup) -> Self {
        Self::at(block, setup, Now::new())
    }

    /// The same at a given instant.
    pub fn at(block: &Faults, setup: &Setup, now: Now) -> Self {
        let mut records: Vec<&FaultRecord> = block.kept().collect();
        records.sort_by_key(|record| std::cmp::Reverse((record.changed_ns, record.number)));
        let overall = OverallState::from_repr(block.overall);
        Self {
            schema_version: 1,
            graph: setup.file.graph.name.clone(),
            overall: overall.map_or("?", OverallState::name),
            faults: records
                .iter()
                .map(|it| NamedFault::new(it, setup, &now))
                .collect(),
            dropped: block.dropped_count,
            revision: (block.header.epoch, block.revision),
        }
    }

    /// True if there is a fault that somebody has to look after, or nobody knows.
    pub fn needs_attention(&self) -> bool {
        if self.overall == OverallState::Stale.name() {
            return true;
        }
        let open = [FaultState::Active, FaultState::Latched].map(FaultState::name);
        self.faults.iter().any(|it| open.contains(&it.state))
    }

    /// The same, but nothing has been heard since.
    pub fn gone_stale(&self) -> Self {
        Self {
            overall: OverallState::Stale.name(),
            ..self.clone()
        }
    }

    /// True if another has something else to say.
    pub fn differs_from(&self, other: &Self) -> bool {
        (self.revision, self.overall) != (other.revision, other.overall)
    }
}

impl NamedFault {
    /// How long it has been present, s; of one that is over, or has come again, since its state
    /// changed.
    pub fn lasts_s(&self) -> f64 {
        let present = [FaultState::Active, FaultState::Acknowledged].map(FaultState::name);
        match present.contains(&self.state) && self.count == 1 {
            true => self.first_ago_s,
            false => self.changed_ago_s,
        }
    }

    fn new(record: &FaultRecord, setup: &Setup, now: &Now) -> Self {
        let action = setup.decision.actions().get(record.action as usize);
        let is_robot = record.source == FaultSource::Robot as u32;
        let size_kind = SizeKind::from_wire(record.size_kind);
        let has_size = is_robot && size_kind != SizeKind::None;
        let evidence = (is_robot && record.evidence > 0.0).then(|| NamedEvidence {
            channel: evidence_name(&setup.robot, record.evidence_channel as usize),
            against: setup.tree.mode_name(record.runner_up).to_owned(),
            nat: record.evidence,
        });
        let source = FaultSource::from_repr(record.source);
        let severity = Severity::from_repr(record.severity);
        Self {
            number: record.number,
            name: fault_name(&setup.tree, record.source, record.what).to_owned(),
            source: source.map_or("?", FaultSource::name),
            state: record.state().map_or("?", FaultState::name),
            severity: severity.map_or("?", Severity::name),
            count: record.count,
            first_unix_s: now.unix_s(record.first_ns),
            last_unix_s: now.unix_s(record.last_ns),
            changed_unix_s: now.unix_s(record.changed_ns),
            first_ago_s: now.ago_s(record.first_ns),
            changed_ago_s: now.ago_s(record.changed_ns),
            p: record.p,
            size: has_size.then(|| FaultSize::new(size_kind, record)),
            evidence,
            action: action.map_or_else(|| "?".to_owned(), Clone::clone),
            freeze_frame: FreezeFrame::new(record, setup),
        }
    }
}

impl FaultSize {
    fn new(kind: SizeKind, record: &FaultRecord) -> Self {
        let unit = kind.unit();
        Self {
            way: kind.word(),
            value: unit.map(|_| record.size),
            sd: unit.map(|_| record.size_sd),
            unit,
            text: kind.text(record.size, record.size_sd),
        }
    }
}

impl FreezeFrame {
    fn new(record: &FaultRecord, setup: &Setup) -> Option<Self> {
        let places = channels(&setup.robot).into_iter().enumerate();
        let measured = places.filter(|(at, _)| record.channel_valid >> at & 1 == 1);
        let channels = measured.map(|(at, channel)| NamedValue {
            name: channel.name,
            value: record.channel[at],
            unit: channel.unit,
        });
        let axes = setup.robot.command.iter().zip(&record.command).enumerate();
        let known = axes.filter(|(at, _)| record.command_valid >> at & 1 == 1);
        let command = known.map(|(_, (axis, value))| NamedValue {
            name: axis.name.clone(),
            value: *value,
            unit: axis.unit.clone(),
        });
        (record.frame_t_capture_ns != 0).then(|| Self {
            t_capture_ns: record.frame_t_capture_ns,
            channels: channels.collect(),
            command: command.collect(),
        })
    }
}
