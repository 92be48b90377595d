//! One cell: a rate, a load, a scheduling policy.

use std::error::Error;
use std::path::Path;
use std::time::Duration;

use super::canary::{Canary, CanaryRecord};
use clap::ValueEnum;
use serde_json::{Value, json};
use vigil_blocks::{Action, DetectionBelief, FaultBelief, ParticleBlock, SensorFrame};
use vigil_cycle::latency::Percentiles;
use vigil_cycle::placement::PlacementRequest;
use vigil_cycle::{CycleStamps, Latency, Placement};

use super::attribution::{self, Miss, Record};
use super::cycles::{self, Cycle, Spectra};
use super::graph::{Change, GraphFile, GraphRun};
use super::load::{Load, LoadProcess};
use super::system::Ticks;
use crate::chain::carriers::Carrier;
use crate::chain::{Chain, STAGE_NAMES, STAGES};

/// Cycles at the start that are no steady state, s.
const WARM_UP_S: f64 = 2.0;
/// The floor runs this share of the graph's time before it, and as much after it.
const FLOOR_SHARE: f64 = 0.25;
/// Time of a floor, s: at least, and at most.
const FLOOR_S: [f64; 2] = [4.0, 60.0];
/// Time beside graph and floors in which canaries run: starting and ending processes, s.
const AROUND_S: f64 = 240.0;
/// Instants at the very end that the monitor may count and nothing answers.
const LAST_INSTANTS_MAX: u64 = 100;
/// Time for a load to get going.
const LOAD_START: Duration = Duration::from_secs(1);

/// Bytes that each stage of the graph writes in a cycle.
const SIZES: [usize; STAGES] = [
    size_of::<SensorFrame>(),
    size_of::<DetectionBelief>() + size_of::<ParticleBlock>(),
    size_of::<FaultBelief>() + size_of::<ParticleBlock>(),
    size_of::<Action>(),
];

/// How the graph is scheduled.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, ValueEnum)]
pub enum Scheduling {
    /// `SCHED_FIFO`, where permitted.
    Fifo,
    /// `SCHED_OTHER`.
    Other,
}

/// What is measured.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Spec {
    /// Rate of the schedule, Hz.
    pub rate_hz: f64,
    /// Load beside the graph.
    pub load: Load,
    /// How the graph is scheduled.
    pub scheduling: Scheduling,
    /// Time of the graph's run, s.
    pub seconds: f64,
    /// Most hypotheses of the identifier, or its particles.
    pub particles: usize,
    /// True if a filter of particles identifies and a wheel sticks at the beginning: then every
    /// particle is stepped in every cycle.
    pub is_faulty: bool,
}

/// What was found.
#[derive(Debug)]
pub struct Cell {
    /// What was measured.
    pub spec: Spec,
    /// The launcher's document of the graph's run.
    pub summary: Value,
    /// Cycles of the graph after the warm-up.
    pub cycles: Vec<Cycle>,
    /// Their histograms.
    pub graph: Spectra,
    /// The same of the floor, before and after the graph together.
    pub floor: Spectra,
    /// What the canaries saw while the graph ran and the floors.
    pub canaries: Vec<CanaryRecord>,
    /// Cycles past the last deadline of the chain.
    pub misses: Vec<Miss>,
    /// Instants that each stage has answered after its own deadline: Vigil's own, the machine's.
    pub stage_misses: [(u64, u64); STAGES],
    /// False if no canary could be placed above the graph: every miss counts as Vigil's own.
    pub is_attributed: bool,
    /// Late instants of the whole run, from the supervisor's first answer to its last, counted from
    /// the stamps: what its monitor counts too, and to the end of the run beyond.
    pub recounted: u64,
    /// Text of the graph file.
    pub graph_file: String,
    /// The graph's.
    pub seed: u64,
    /// Deadline of the chain after the schedule, ns.
    pub deadline_ns: u64,
    /// Wake-ups of the canaries, in a million, that were late by the slack of a usual cycle; `None`
    /// if a usual cycle has none.
    pub canary_late_ppm: Option<f64>,
    /// What the machine did meanwhile.
    pub system: Value,
    /// Core and priority wanted for each stage.
    pub wanted: [PlacementRequest; STAGES],
}

impl Spec {
    /// Name of the cell in files: `1000hz-cpu-fifo`.
    #[must_use]
    pub fn name(&self) -> String {
        let scheduling = match self.scheduling {
            Scheduling::Fifo => "fifo",
            Scheduling::Other => "other",
        };
        let faulty = if self.is_faulty { "-faulty" } else { "" };
        format!(
            "{}hz-{}-{scheduling}{faulty}",
            self.rate_hz,
            self.load.name()
        )
    }

    /// Runs the cell; what it needs for the time lies in `folder`.
    ///
    /// # Errors
    /// If the graph, the floor or the load fails.
    pub fn run(&self, folder: &Path) -> Result<Cell, Box<dyn Error>> {
        let change = Change {
            rate_hz: self.rate_hz,
            particles: self.particles,
            is_fifo: self.scheduling == Scheduling::Fifo,
            is_faulty: self.is_faulty,
        };
        let prepared = GraphFile::new(change, folder)?;
        let wanted = prepared.wanted();
        let period_ns = prepared.setup().period_ns();
        let floor_s = (FLOOR_SHARE * self.seconds).clamp(FLOOR_S[0], FLOOR_S[1]);
        let floor = Chain {
            carrier: Carrier::Futex,
            sizes: SIZES,
            placed: wanted.map(|w| (w.core, w.priority)),
            period_ns,
            cycles: (floor_s * self.rate_hz) as u64,
        };
        let load = LoadProcess::start(self.load, &prepared.cores(), folder, Some(prepared.path()))?;
        std::thread::sleep(LOAD_START);
        let canaries = prepared.canaries(self.seconds + 2.0 * floor_s + AROUND_S)?;
        let before = floor.run(folder)?;
        let ticks = Ticks::now();
        let ran = prepared.run(self.seconds, folder)?;
        let system = Ticks::now().since(ticks);
        let after = floor.run(folder)?;
        let canaries: Vec<CanaryRecord> = canaries.into_iter().filter_map(Canary::finish).collect();
        load.finish()?;
        self.judge(&prepared, (ran, [before, after]), canaries, system)
    }

    fn judge(
        &self,
        prepared: &GraphFile,
        (ran, floors): (GraphRun, [[Vec<CycleStamps>; STAGES]; 2]),
        canaries: Vec<CanaryRecord>,
        system: Value,
    ) -> Result<Cell, Box<dyn Error>> {
        let (wanted, deadline_ns) = (prepared.wanted(), prepared.deadline_ns());
        let period_ns = prepared.setup().period_ns();
        let is_attributed = check(&ran.summary, &canaries, &wanted)?;
        let first = ran.stamps[STAGES - 1].first();
        let first = first.ok_or("the graph did nothing")?;
        let from_ns = first.t_schedule_ns + (WARM_UP_S * 1e9) as u64;
        let mut cycles = cycles::join(&ran.stamps, period_ns, 0);
        let recounted = recounted(&cycles, deadline_ns, &ran.summary)?;
        cycles.retain(|cycle| cycle.t_schedule_ns >= from_ns);
        let believed = canaries.iter().filter(|_| is_attributed);
        let records: Vec<Record<'_>> = believed.map(Record::from_canary).collect();
        if cycles.iter().all(Cycle::is_folded) {
            return Err("no instant after the warm-up has the stamps of every stage".into());
        }
        let misses = attribution::misses(&cycles, deadline_ns, &records);
        let stage_misses = std::array::from_fn(|i| {
            let mut cycles = cycles::of_stage(&ran.stamps[i], period_ns);
            cycles.retain(|cycle| cycle.t_schedule_ns >= from_ns);
            let deadline_ns = prepared.stage_deadline_ns(i);
            counts(&attribution::misses(&cycles, deadline_ns, &records))
        });
        let graph = Spectra::new(&cycles)?;
        let floors = floors.iter().flat_map(|stamps| {
            let first = stamps[0].first().map_or(0, |s| s.t_schedule_ns);
            cycles::join(stamps, period_ns, first + (1e9 * WARM_UP_S / 4.0) as u64)
        });
        let floor = Spectra::new(&floors.collect::<Vec<_>>())?;
        let usual_ns = graph.end_to_end.percentiles().p50_ns;
        let slack_ns = deadline_ns.saturating_sub(usual_ns);
        let late = |canary: &CanaryRecord| {
            canary
                .lateness
                .histogram()
                .count_between(slack_ns.max(1), u64::MAX)
        };
        let all: u64 = canaries.iter().map(|c| c.lateness.percentiles().n).sum();
        let late: u64 = canaries.iter().map(late).sum();
        Ok(Cell {
            spec: *self,
            summary: ran.summary,
            graph,
            floor,
            misses,
            stage_misses,
            is_attributed,
            recounted,
            graph_file: prepared.text()?,
            seed: prepared.setup().file.graph.seed,
            deadline_ns,
            canary_late_ppm: (slack_ns > 0).then(|| 1e6 * late as f64 / all.max(1) as f64),
            system,
            wanted,
            cycles,
            canaries,
        })
    }
}

/// Late instants of a whole run.
///
/// # Errors
/// If the supervisor's monitor has counted otherwise.
fn recounted(cycles: &[Cycle], deadline_ns: u64, summary: &Value) -> Result<u64, String> {
    let is_late = |cycle: &&Cycle| cycle.end_to_end_ns() > deadline_ns;
    let recounted = cycles.iter().filter(is_late).count() as u64;
    // It goes on counting until it is stopped, after its last answer.
    let monitor = missed_by_the_monitor(summary).unwrap_or(0);
    if (recounted..=recounted + LAST_INSTANTS_MAX).contains(&monitor) {
        return Ok(recounted);
    }
    Err(format!(
        "the monitor counted {monitor} misses, the stamps say {recounted}"
    ))
}

/// What the supervisor's deadline monitor has counted in the whole run.
fn missed_by_the_monitor(summary: &Value) -> Option<u64> {
    summary["services"][STAGE_NAMES[STAGES - 1]]["missed"].as_u64()
}

/// Refuses what would not be a measurement: a service that was restarted (its stamps are those
/// since then), a canary that forgot. False if canaries ran elsewhere or below what they watch
/// over, as without the right to real-time priority.
pub(super) fn check(
    summary: &Value,
    canaries: &[CanaryRecord],
    wanted: &[PlacementRequest; STAGES],
) -> Result<bool, Box<dyn Error>> {
    for name in STAGE_NAMES {
        if summary["services"][name]["restarts"] != 0 {
            return Err(format!("{name} was restarted in the run").into());
        }
    }
    let highest = wanted.iter().map(|w| u32::from(w.priority)).max();
    let is_above = |canary: &CanaryRecord| {
        canary.placement.pinned && canary.placement.priority > highest.unwrap_or(0)
    };
    if canaries.iter().any(|canary| canary.not_kept > 0) {
        return Err("a canary had no room for what it saw: nobody can say whose a miss is".into());
    }
    Ok(!canaries.is_empty() && canaries.iter().all(is_above))
}

/// Vigil's own, and the machine's.
fn counts(misses: &[Miss]) -> (u64, u64) {
    let machine = misses.iter().filter(|m| m.is_machine).count() as u64;
    (misses.len() as u64 - machine, machine)
}

/// Percentiles in us.
#[must_use]
pub fn us(latency: &Latency) -> Value {
    let Percentiles {
        n,
        p50_ns,
        p90_ns,
        p99_ns,
        p999_ns,
        max_ns,
        ..
    } = latency.percentiles();
    let us = |ns: u64| ns as f64 * 1e-3;
    json!({
        "n": n, "p50": us(p50_ns), "p90": us(p90_ns), "p99": us(p99_ns), "p999": us(p999_ns),
        "max": us(max_ns),
    })
}

impl Cell {
    /// Misses of Vigil's own, and the machine's.
    #[must_use]
    pub fn missed(&self) -> (u64, u64) {
        counts(&self.misses)
    }

    /// Misses of Vigil's own of each stage by its own deadline, in the order of data: `0/0/2/0`.
    #[must_use]
    pub fn own_by_stage(&self) -> String {
        self.stage_misses
            .map(|(ours, _)| ours.to_string())
            .join("/")
    }

    /// How many times as often cycles were missed by the machine as wake-ups of the canaries were
    /// late by the slack of a usual cycle; `None` if these never were.
    #[must_use]
    pub fn machine_over_canary(&self) -> Option<f64> {
        let canary_ppm = self.canary_late_ppm.filter(|ppm| *ppm > 0.0)?;
        let machine_ppm = 1e6 * self.missed().1 as f64 / self.cycles.len() as f64;
        Some(machine_ppm / canary_ppm)
    }

    /// Instants that only a later one's answer ended.
    #[must_use]
    pub fn folded(&self) -> usize {
        self.cycles.iter().filter(|cycle| cycle.is_folded()).count()
    }

    /// Misses that no single late wake-up of a canary explains.
    #[must_use]
    pub fn not_one_stall(&self) -> u64 {
        self.misses.iter().filter(|m| !m.is_one_stall).count() as u64
    }

    /// The slowest cycle: which, and when it was due.
    fn slowest(&self) -> Value {
        let cycles = self.cycles.iter().enumerate();
        let slowest = cycles.max_by_key(|(_, cycle)| cycle.end_to_end_ns());
        slowest.map_or(Value::Null, |(i, cycle)| {
            let after_ns = cycle.t_schedule_ns - self.cycles[0].t_schedule_ns;
            json!({ "cycle": i, "after_s": after_ns as f64 * 1e-9 })
        })
    }

    /// End to end minus compute, over the floor's: ratios of p50 and p99.
    #[must_use]
    pub fn over_floor(&self) -> (f64, f64) {
        let (graph, floor) = (
            self.graph.hand_over.percentiles(),
            self.floor.hand_over.percentiles(),
        );
        let ratio = |a: u64, b: u64| a as f64 / b.max(1) as f64;
        (
            ratio(graph.p50_ns, floor.p50_ns),
            ratio(graph.p99_ns, floor.p99_ns),
        )
    }

    /// The cell for programs.
    #[must_use]
    pub fn json(&self) -> Value {
        let (ours, machine) = self.missed();
        let (p50, p99) = self.over_floor();
        let round = |x: f64| (1e3 * x).round() * 1e-3;
        let stage = |i: usize| {
            let (hand_over, compute) = &self.graph.stages[i];
            let of = &self.summary["services"][STAGE_NAMES[i]];
            let (ours, machine) = self.stage_misses[i];
            json!({
                "missed": { "ours": ours, "machine": machine },
                "hand_over_us": us(hand_over), "compute_us": us(compute),
                "core": of["core"], "core_wanted": self.wanted[i].core, "pinned": of["pinned"],
                "scheduling": of["scheduling"], "memory_locked": of["memory_locked"],
                "timer_slack_ns": of["timer_slack_ns"],
                "missed_by_its_monitor": of["missed"], "lost": of["lost"], "late": of["late"],
                "duplicate": of["duplicate"], "slips": of["slips"],
                "page_faults": of["page_faults"],
            })
        };
        let stages: serde_json::Map<String, Value> = (0..STAGES)
            .map(|i| (STAGE_NAMES[i].to_owned(), stage(i)))
            .collect();
        let canary_json = |canary: &CanaryRecord| {
            let placement = &canary.placement;
            json!({
                "core": placement.core,
                "scheduling": Placement::scheduling(placement.policy, placement.priority),
                "lateness_us": us(&canary.lateness),
                "not_kept": canary.not_kept,
            })
        };
        json!({
            "rate_hz": self.spec.rate_hz,
            "load": self.spec.load.name(),
            "load_arguments": self.spec.load.arguments(self.canaries.len()).join(" "),
            "scheduling": self.summary["services"]["supervisor"]["scheduling"],
            "seconds": self.spec.seconds,
            "particles": self.spec.particles,
            "end_to_end_us": us(&self.graph.end_to_end),
            "compute_us": us(&self.graph.compute),
            "hand_over_us": us(&self.graph.hand_over),
            "floor_us": us(&self.floor.hand_over),
            "floor_end_to_end_us": us(&self.floor.end_to_end),
            "over_floor": { "p50": round(p50), "p99": round(p99) },
            "deadline_us": self.deadline_ns as f64 * 1e-3,
            "missed": { "ours": ours, "machine": machine },
            "attributed": self.is_attributed,
            "whole_run": {
                "missed_by_the_monitor": missed_by_the_monitor(&self.summary),
                "missed_by_recount": self.recounted,
            },
            "missed_without_one_long_stall": self.not_one_stall(),
            "canary_late_ppm": self.canary_late_ppm.map(round),
            "machine_over_canary": self.machine_over_canary().map(round),
            "max_at": self.slowest(),
            "cycles": self.cycles.len(),
            "folded": self.folded(),
            "seed": self.seed,
            "stages": stages,
            "canaries": self.canaries.iter().map(canary_json).collect::<Vec<_>>(),
            "system": self.system,
            "config_hash": self.summary["config_hash"],
            "release_build": self.summary["release_build"],
        })
    }
}
