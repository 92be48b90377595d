//! The summary of a run, for people and for programs.

use std::collections::BTreeMap;
use std::fmt;

use schemars::JsonSchema;
use serde::Serialize;
use vigil_blocks::{Health, Rejection};
use vigil_cycle::latency::Percentiles;
use vigil_cycle::topic::ServiceName;
use vigil_cycle::{Placement, RunReport};
use vigil_setup::Setup;
use vigil_timeline::{Timeline, TimelineEntry, told};

use crate::observer::Counters;

/// Why a run ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum EndReason {
    /// The duration is over.
    Duration,
    /// The recording is over.
    EndOfRecording,
    /// Ctrl-C or SIGTERM.
    Stopped,
    /// A service died too often.
    GaveUp,
    /// The graph never came up.
    NeverReady,
}

/// A latency distribution, us.
#[derive(Debug, Clone, Copy, Default, Serialize, JsonSchema)]
pub struct Microseconds {
    /// How many.
    n: u64,
    /// Median.
    p50: f64,
    /// Nine of ten lie below.
    p90: f64,
    /// 99 of 100 lie below.
    p99: f64,
    /// 999 of 1000 lie below.
    p999: f64,
    /// The largest.
    max: f64,
}

impl From<Percentiles> for Microseconds {
    fn from(p: Percentiles) -> Self {
        let us = |ns: u64| ns as f64 * 1e-3;
        Self {
            n: p.n,
            p50: us(p.p50_ns),
            p90: us(p.p90_ns),
            p99: us(p.p99_ns),
            p999: us(p.p999_ns),
            max: us(p.max_ns),
        }
    }
}

/// What one service did.
#[derive(Debug, Clone, Serialize, JsonSchema)]
pub struct ServiceSummary {
    #[serde(flatten)]
    counters: Counters,
    /// Refused input by cause; causes that did not occur are left out.
    rejected: BTreeMap<&'static str, u64>,
    /// How often it was started again.
    restarts: usize,
    /// Its last process.
    pid: u32,
    /// Core on which it runs.
    core: u32,
    /// Core that the configuration asks for.
    core_wanted: u32,
    /// True if it is pinned there.
    pinned: bool,
    /// Its scheduling class and priority.
    scheduling: String,
    /// Of the thread that cycles; null if the service left no report.
    timer_slack_ns: Option<u64>,
    /// True if its memory is locked.
    memory_locked: bool,
    /// From the due instant to the wake-up.
    #[serde(skip_serializing_if = "Option::is_none")]
    wake_up_us: Option<Microseconds>,
    /// Of its computation.
    #[serde(skip_serializing_if = "Option::is_none")]
    step_us: Option<Microseconds>,
    /// From the schedule of a cycle to its output.
    #[serde(skip_serializing_if = "Option::is_none")]
    from_schedule_us: Option<Microseconds>,
    /// Minor and major page faults in the steady state.
    #[serde(skip_serializing_if = "Option::is_none")]
    page_faults: Option<[u64; 2]>,
}

/// What happened in a run.
#[derive(Debug, Clone, Serialize, JsonSchema)]
pub struct Summary {
    /// Version of this document.
    schema_version: u32,
    /// Name of the graph.
    graph: String,
    /// Rate of its schedule.
    rate_hz: f64,
    /// Time since every service answered for the first time.
    duration_s: f64,
    /// Why it ended.
    ended: EndReason,
    /// False of a debug build: its times mean nothing.
    release_build: bool,
    /// Hash of the configuration and every file that it names.
    config_hash: String,
    /// What each service did, by its name.
    services: BTreeMap<&'static str, ServiceSummary>,
    /// From the schedule of a cycle to its action.
    end_to_end_us: Microseconds,
    /// Per detector, how long it saw nothing, s, by cause.
    blind: BTreeMap<&'static str, BTreeMap<&'static str, f64>>,
    /// What happened, in order.
    events: Vec<TimelineEntry>,
    /// Events that were lost before they could be read.
    events_overwritten: u64,
    /// The service that was given up, and why.
    #[serde(skip_serializing_if = "Option::is_none")]
    gave_up: Option<String>,
}

/// What is known of a service at the end.
#[derive(Debug, Clone)]
pub struct ServiceRecord {
    /// Which service.
    pub name: ServiceName,
    /// Its newest Health.
    pub health: Option<Box<Health>>,
    /// Its counters over all its processes.
    pub counters: Counters,
    /// How often it was started again.
    pub restarts: usize,
    /// The report of its last process.
    pub report: Option<RunReport>,
}

/// How a run went.
#[derive(Debug, Clone)]
pub struct RunEnd {
    /// Why it ended.
    pub ended: EndReason,
    /// How long it lasted, s, from the first cycle in which every service answered.
    pub duration_s: f64,
    /// When it ended, ns.
    pub end_ns: u64,
    /// The service that was given up, and why.
    pub gave_up: Option<String>,
}

impl Summary {
    /// Collects what is known of a run and its services.
    pub fn new(setup: &Setup, timeline: &Timeline, records: &[ServiceRecord], run: RunEnd) -> Self {
        let services = records.iter().map(|r| (r.name.as_str(), service(r)));
        let supervisor = records.iter().find(|r| r.name == ServiceName::Supervisor);
        let report = supervisor.and_then(|r| r.report.as_ref());
        let end_to_end = report.map(|report| report.from_schedule.percentiles);
        let blind_s = timeline.blind_s(run.end_ns);
        let blind = (!blind_s.is_empty()).then_some((ServiceName::Detector.as_str(), blind_s));
        Self {
            schema_version: 1,
            graph: setup.file.graph.name.clone(),
            rate_hz: setup.file.graph.rate_hz,
            duration_s: run.duration_s,
            ended: run.ended,
            release_build: !cfg!(debug_assertions),
            config_hash: format!("{:016x}", setup.hash),
            services: services.collect(),
            end_to_end_us: end_to_end.unwrap_or_default().into(),
            blind: blind.into_iter().collect(),
            events: timeline.entries(),
            events_overwritten: timeline.overwritten(),
            gave_up: run.gave_up,
        }
    }

    /// True if the run itself failed, an assertion did, or the graph was blind for a part of it or
    /// for all of it.
    pub fn failed(&self) -> bool {
        matches!(self.ended, EndReason::GaveUp | EndReason::NeverReady)
            || !self.blind.is_empty()
            || self.events.iter().any(|entry| entry.event == "assertion")
            || self.saw_nothing()
    }

    /// True if no cycle ran through all services.
    fn saw_nothing(&self) -> bool {
        self.duration_s <= 0.0
    }
}

fn service(record: &ServiceRecord) -> ServiceSummary {
    let (counters, report) = (&record.counters, record.report.as_ref());
    let health = record.health.as_deref();
    let latency = |get: fn(&RunReport) -> Percentiles| report.map(|r| get(r).into());
    ServiceSummary {
        counters: *counters,
        rejected: Rejection::ALL
            .iter()
            .map(|cause| (cause.as_str(), counters.rejected[*cause as usize]))
            .filter(|(_, count)| *count > 0)
            .collect(),
        restarts: record.restarts,
        pid: health.map_or(0, |h| h.pid),
        core: health.map_or(u32::MAX, |h| h.core),
        core_wanted: health.map_or(u32::MAX, |h| h.core_wanted),
        pinned: health.is_some_and(|h| h.pinned != 0),
        scheduling: health.map_or_else(
            || "unknown".into(),
            |h| Placement::scheduling(h.policy, h.priority),
        ),
        timer_slack_ns: report.and_then(|r| r.timer_slack_ns),
        memory_locked: health.is_some_and(|h| h.memory_locked != 0),
        wake_up_us: latency(|r| r.wake_up.percentiles),
        step_us: latency(|r| r.step.percentiles),
        from_schedule_us: latency(|r| r.from_schedule.percentiles),
        page_faults: report.and_then(|r| r.page_faults),
    }
}

impl fmt::Display for Summary {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self {
            graph,
            rate_hz,
            duration_s,
            ..
        } = self;
        writeln!(f, "\ngraph {graph}: {duration_s:.1} s at {rate_hz} Hz")?;
        if !self.release_build {
            writeln!(f, "DEBUG BUILD: the times below mean nothing")?;
        }
        self.placement(f)?;
        writeln!(
            f,
            "  service      core  scheduling   cycles  missed  over budget  slips  lost  late  \
             restarts  step p99"
        )?;
        for (name, s) in self.in_order() {
            let counters = &s.counters;
            let step = s
                .step_us
                .map_or_else(|| "-".into(), |l| format!("{:.0} us", l.p99));
            writeln!(
                f,
                "  {name:<11} {:>5}  {:<10} {:>8} {:>7} {:>12} {:>6} {:>5} {:>5} {:>9}  {step}",
                s.core,
                s.scheduling,
                counters.cycles,
                counters.missed,
                counters.over_budget,
                counters.slips,
                counters.lost,
                counters.late,
                s.restarts
            )?;
        }
        for (name, s) in self.in_order().filter(|(_, s)| !s.rejected.is_empty()) {
            let causes = s.rejected.iter().map(|(cause, n)| format!("{n} {cause}"));
            let causes = causes.collect::<Vec<_>>().join(", ");
            writeln!(f, "  {name} refused input: {causes}")?;
        }
        let e = &self.end_to_end_us;
        writeln!(
            f,
            "  end to end, from the schedule to the action: p50 {:.0}, p90 {:.0}, p99 {:.0}, \
             p99.9 {:.0}, max {:.0} us (n = {})",
            e.p50, e.p90, e.p99, e.p999, e.max, e.n
        )?;
        if self.services.values().any(|s| s.restarts > 0) {
            writeln!(
                f,
                "  latencies of a restarted service are those since its last start"
            )?;
        }
        self.unseen(f)?;
        writeln!(f, "  timeline:")?;
        for event in told(&self.events) {
            writeln!(f, "  {}", event.line())?;
        }
        if let Some(gave_up) = &self.gave_up {
            writeln!(f, "  given up: {gave_up}")?;
        }
        Ok(())
    }
}

impl Summary {
    fn in_order(&self) -> impl Iterator<Item = (&'static str, &ServiceSummary)> {
        ServiceName::ALL
            .iter()
            .filter_map(|name| self.services.get(name.as_str()).map(|s| (name.as_str(), s)))
    }

    /// Says openly what was not seen.
    fn unseen(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if self.saw_nothing() {
            writeln!(
                f,
                "  no cycle ran through all services: no frame came, or none was good"
            )?;
        }
        for (name, causes) in &self.blind {
            let causes = causes
                .iter()
                .map(|(cause, s)| format!("{s:.1} s ({cause})"));
            let causes = causes.collect::<Vec<_>>().join(", ");
            writeln!(f, "  {name} was blind: {causes}")?;
        }
        Ok(())
    }

    /// Says openly which services share a core, and what was not permitted.
    fn placement(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mut cores: BTreeMap<u32, Vec<&str>> = BTreeMap::new();
        for (name, service) in self.in_order() {
            cores.entry(service.core).or_default().push(name);
            if !service.pinned {
                let (core, wanted) = (service.core, service.core_wanted);
                writeln!(
                    f,
                    "  {name} runs on core {core} and is not pinned to {wanted} as asked"
                )?;
            }
            if service.scheduling == "other" {
                writeln!(
                    f,
                    "  {name} runs under SCHED_OTHER: real-time priority not permitted"
                )?;
            }
            if !service.memory_locked {
                writeln!(f, "  {name}: memory is not locked: not permitted")?;
            }
        }
        for (core, names) in cores.iter().filter(|(_, names)| names.len() > 1) {
            writeln!(f, "  core {core} is shared by {}", names.join(", "))?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plan::tests::plan;
    use vigil_blocks::{Blindness, Event, EventKind};
    use vigil_cycle::Timing;

    const S: u64 = 1_000_000_000;

    fn record(name: ServiceName) -> ServiceRecord {
        let mut timing = Timing::new().unwrap();
        (1..=100).for_each(|us| timing.from_schedule.record(us * 1000));
        let health = Health {
            core: 1,
            core_wanted: 1,
            pinned: 1,
            memory_locked: 1,
            ..Health::default()
        };
        ServiceRecord {
            name,
            health: Some(Box::new(health)),
            counters: Counters {
                cycles: 100,
                missed: 3,
                ..Counters::default()
            },
            restarts: 1,
            report: Some(RunReport::new(name.as_str(), &timing, None).unwrap()),
        }
    }

    fn run(ended: EndReason) -> RunEnd {
        RunEnd {
            ended,
            duration_s: 4.0,
            end_ns: 14 * S,
            gave_up: None,
        }
    }

    #[test]
    fn a_run_without_a_failure_is_none_and_shows_each_service() {
        let setup = plan(&[]).unwrap().setup;
        let records = [ServiceName::Detector, ServiceName::Supervisor].map(record);
        let timeline = Timeline::new(&setup);
        let summary = Summary::new(&setup, &timeline, &records, run(EndReason::Duration));
        assert!(!summary.failed());
        let json = serde_json::to_value(&summary).unwrap();
        assert_eq!(json["ended"], "duration");
        assert_eq!(json["services"]["detector"]["missed"], 3);
        assert_eq!(json["end_to_end_us"]["n"], 100);
        assert_eq!(json["gave_up"], serde_json::Value::Null);
        let text = summary.to_string();
        assert!(
            text.contains("core 1 is shared by detector, supervisor"),
            "{text}"
        );
        assert!(text.contains("detector runs under SCHED_OTHER"), "{text}");
        assert!(text.contains("max 100 us (n = 100)"), "{text}");
    }

    #[test]
    fn what_was_blind_given_up_or_never_ran_is_a_failure_and_is_said() {
        let setup = plan(&[]).unwrap().setup;
        let mut timeline = Timeline::new(&setup);
        timeline.begin(10 * S);
        let blind = Event {
            t_ns: 12 * S,
            kind: EventKind::Blind as u32,
            what: Blindness::Silence as u32,
            ..Event::default()
        };
        timeline.add(ServiceName::Detector, &blind);
        let summary = |timeline, run| Summary::new(&setup, timeline, &[], run);
        let seen_late = summary(&timeline, run(EndReason::Duration));
        assert!(seen_late.failed());
        let text = seen_late.to_string();
        assert!(
            text.contains("detector was blind: 2.0 s (silence)"),
            "{text}"
        );
        let quiet = Timeline::new(&setup);
        assert!(summary(&quiet, run(EndReason::GaveUp)).failed());
        let mut nothing = run(EndReason::Stopped);
        nothing.duration_s = 0.0;
        let nothing = summary(&quiet, nothing);
        assert!(nothing.failed());
        assert!(
            nothing
                .to_string()
                .contains("no cycle ran through all services")
        );
    }
}
