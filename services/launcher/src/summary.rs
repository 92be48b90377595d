//! The readable end of a run, and the same for programs.

use std::collections::BTreeMap;
use std::fmt;

use serde::Serialize;
use vigil_blocks::Rejection;
use vigil_cycle::latency::Percentiles;
use vigil_cycle::topic::ServiceName;
use vigil_cycle::{Placement, RunReport};

use crate::children::Children;
use crate::observer::{Counters, Observer, ServiceView};
use crate::plan::Plan;
use crate::timeline::TimelineEntry;

/// Why a run ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
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
#[derive(Debug, Clone, Copy, Default, Serialize)]
pub struct Microseconds {
    n: u64,
    p50: f64,
    p90: f64,
    p99: f64,
    p999: f64,
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
#[derive(Debug, Clone, Serialize)]
pub struct ServiceSummary {
    cycles: u64,
    missed: u64,
    over_budget: u64,
    slips: u64,
    lost: u64,
    late: u64,
    duplicate: u64,
    invalid: u64,
    /// Refused input by cause; causes that did not occur are left out.
    rejected: BTreeMap<&'static str, u64>,
    restarts: usize,
    pid: u32,
    core: u32,
    core_wanted: u32,
    pinned: bool,
    scheduling: String,
    /// Of the thread that cycles; null if the service left no report.
    timer_slack_ns: Option<u64>,
    memory_locked: bool,
    #[serde(skip_serializing_if = "Option::is_none")]
    wake_up_us: Option<Microseconds>,
    #[serde(skip_serializing_if = "Option::is_none")]
    step_us: Option<Microseconds>,
    #[serde(skip_serializing_if = "Option::is_none")]
    from_schedule_us: Option<Microseconds>,
    /// Minor and major page faults in the steady state.
    #[serde(skip_serializing_if = "Option::is_none")]
    page_faults: Option<[u64; 2]>,
}

/// What happened in a run.
#[derive(Debug, Clone, Serialize)]
pub struct Summary {
    schema_version: u32,
    graph: String,
    rate_hz: f64,
    duration_s: f64,
    ended: EndReason,
    release_build: bool,
    config_hash: String,
    services: BTreeMap<&'static str, ServiceSummary>,
    end_to_end_us: Microseconds,
    /// Per detector, how long it saw nothing, s, by cause.
    blind: BTreeMap<&'static str, BTreeMap<&'static str, f64>>,
    events: Vec<TimelineEntry>,
    events_overwritten: u64,
    #[serde(skip_serializing_if = "Option::is_none")]
    gave_up: Option<String>,
}

impl Summary {
    /// Collects what the observer, the children and their reports know.
    pub fn new(
        plan: &Plan,
        observer: &Observer,
        children: &Children,
        reports: &[(ServiceName, Option<RunReport>)],
        ended: EndReason,
    ) -> Self {
        let report = |name| {
            reports
                .iter()
                .find(|(n, _)| *n == name)
                .and_then(|(_, r)| r.as_ref())
        };
        let services = observer
            .watched()
            .iter()
            .map(|w| {
                (
                    w.name.as_str(),
                    service(
                        w,
                        observer.counters(w),
                        children.restarts(w.name),
                        report(w.name),
                    ),
                )
            })
            .collect();
        let blind_s = observer.timeline().blind_s(observer.end_ns());
        let blind = (!blind_s.is_empty()).then_some((ServiceName::Detector.as_str(), blind_s));
        let end_to_end = report(ServiceName::Supervisor).map(|r| r.from_schedule.percentiles);
        Self {
            schema_version: 1,
            graph: plan.setup.file.graph.name.clone(),
            rate_hz: plan.setup.file.graph.rate_hz,
            duration_s: observer.since_ready_s().unwrap_or(0.0),
            ended,
            release_build: !cfg!(debug_assertions),
            config_hash: format!("{:016x}", plan.setup.hash),
            services,
            end_to_end_us: end_to_end.unwrap_or_default().into(),
            blind: blind.into_iter().collect(),
            events: observer.timeline().told(),
            events_overwritten: observer.timeline().overwritten(),
            gave_up: children
                .gave_up()
                .map(|(name, exit)| format!("{}: {exit}", name.as_str())),
        }
    }

    /// True if the run itself failed, or nothing was seen for a part of it, or for all of it.
    pub fn failed(&self) -> bool {
        matches!(self.ended, EndReason::GaveUp | EndReason::NeverReady)
            || !self.blind.is_empty()
            || self.saw_nothing()
    }

    /// True if no cycle ran through all services.
    fn saw_nothing(&self) -> bool {
        self.duration_s <= 0.0
    }
}

fn service(
    w: &ServiceView,
    counters: Counters,
    restarts: usize,
    report: Option<&RunReport>,
) -> ServiceSummary {
    let health = w.latest.as_deref();
    let of = |get: fn(&RunReport) -> Percentiles| report.map(|r| get(r).into());
    ServiceSummary {
        cycles: counters.cycles,
        missed: counters.missed,
        over_budget: counters.over_budget,
        slips: counters.slips,
        lost: counters.lost,
        late: counters.late,
        duplicate: counters.duplicate,
        invalid: counters.invalid,
        rejected: Rejection::ALL
            .into_iter()
            .map(|cause| (cause.as_str(), counters.rejected[cause as usize]))
            .filter(|(_, count)| *count > 0)
            .collect(),
        restarts,
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
        wake_up_us: of(|r| r.wake_up.percentiles),
        step_us: of(|r| r.step.percentiles),
        from_schedule_us: of(|r| r.from_schedule.percentiles),
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
            let step = s
                .step_us
                .map_or_else(|| "-".into(), |l| format!("{:.0} us", l.p99));
            writeln!(
                f,
                "  {name:<11} {:>5}  {:<10} {:>8} {:>7} {:>12} {:>6} {:>5} {:>5} {:>9}  {step}",
                s.core,
                s.scheduling,
                s.cycles,
                s.missed,
                s.over_budget,
                s.slips,
                s.lost,
                s.late,
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
        for event in &self.events {
            writeln!(f, "  {event}")?;
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
