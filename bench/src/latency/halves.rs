//! The graph in interleaved pairs, with something and without, and what that costs: in halves of
//! one run where it can come and go, else in runs of their own.

use std::error::Error;
use std::sync::mpsc::{Sender, channel};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use serde_json::{Value, json};
use vigil_blocks::{Action, CauseKind};
use vigil_cycle::canary::{Canary, Seen};
use vigil_cycle::placement::Wanted;
use vigil_cycle::port::Link;
use vigil_cycle::{Clock, CycleStamps, Domain, Graph, Latency, Monotonic, Topic, placement};

use super::attribution::{Miss, Record, misses};
use super::cell::{self, us};
use super::cycles::{Cycle, of_stage};
use super::graph::Prepared;
use crate::archive::Archive;
use crate::pairs::median_ratio;
use crate::{has_percentile, percentile};

/// Actions at the start of a run that do not count, s.
const WARM_UP_S: f64 = 2.0;
/// Time at the start of each half of a run that does not count: the other one ends in it.
const SETTLE: Duration = Duration::from_millis(500);
/// Time beside the run in which canaries run, s.
const AROUND_S: f64 = 60.0;
/// The reader of the actions runs above ordinary processes and below the graph.
const READER_PRIORITY: u8 = 10;
/// Interval at which a run is looked after.
const LOOK: Duration = Duration::from_millis(50);

/// What one half showed.
#[derive(Debug)]
pub struct Half {
    /// From the schedule to the action.
    pub end_to_end: Latency,
    /// Misses of Vigil's own.
    pub ours: usize,
    /// The machine's.
    pub machine: usize,
}

impl Half {
    /// Of the instants from `from_ns` to `to_ns`.
    fn of(ran: &Ran, [from_ns, to_ns]: [u64; 2]) -> Result<Self, Box<dyn Error>> {
        let is_within = |t_ns: u64| (from_ns..to_ns).contains(&t_ns);
        let mut end_to_end = Latency::new()?;
        let cycles = ran.cycles.iter().filter(|c| is_within(c.t_schedule_ns));
        cycles.for_each(|cycle| end_to_end.record(cycle.end_to_end_ns()));
        let missed = ran.misses.iter().filter(|m| is_within(m.t_schedule_ns));
        let (machine, ours): (Vec<&Miss>, Vec<&Miss>) = missed.partition(|m| m.is_machine);
        Ok(Self {
            end_to_end,
            ours: ours.len(),
            machine: machine.len(),
        })
    }
}

/// Runs pairs: `one(true)` is a run with what makes the difference, `one(false)` one without. The
/// order changes from pair to pair: a drift of the machine falls on both alike.
///
/// # Errors
/// Those of a run.
pub fn interleaved(
    pairs: usize,
    mut one: impl FnMut(bool) -> Result<Half, Box<dyn Error>>,
) -> Result<Vec<[Half; 2]>, Box<dyn Error>> {
    let mut all = Vec::new();
    for pair in 0..pairs {
        eprintln!("pair {} of {pairs}", pair + 1);
        let first_with = pair % 2 == 1;
        let (first, second) = (one(first_with)?, one(!first_with)?);
        all.push(in_order(first_with, first, second));
    }
    Ok(all)
}

/// Without, then with.
fn in_order<T>(first_with: bool, first: T, second: T) -> [T; 2] {
    if first_with {
        [second, first]
    } else {
        [first, second]
    }
}

/// Runs the graph once for all pairs, halves of `half_s` in the same order. `beside(Some(true))` is
/// called again and again in a half with what makes the difference, `beside(Some(false))` in one
/// without, `beside(None)` before the first.
///
/// # Errors
/// If the graph fails, or `beside` does.
pub fn alternating(
    prepared: &Prepared,
    (pairs, half_s): (usize, f64),
    mut beside: impl FnMut(Option<bool>) -> Result<(), Box<dyn Error>>,
) -> Result<Vec<[Half; 2]>, Box<dyn Error>> {
    let mut times = Vec::new();
    let half = Duration::from_secs_f64(half_s);
    let seconds = WARM_UP_S + 2.0 * pairs as f64 * half_s + 2.0;
    let ran = watched(prepared, seconds, &[], |has_acted| {
        look_after(Duration::from_secs_f64(WARM_UP_S), || beside(None))?;
        // Before the publisher that `beside` may have begun with, nothing is done.
        let until = Instant::now() + Duration::from_secs_f64(AROUND_S);
        while !has_acted() {
            if Instant::now() > until {
                return Err("the graph did nothing".into());
            }
            look_after(LOOK, || beside(None))?;
        }
        for pair in 0..pairs {
            eprintln!("pair {} of {pairs}", pair + 1);
            let first_with = pair % 2 == 1;
            let mut one = |with: bool| -> Result<[u64; 2], Box<dyn Error>> {
                look_after(SETTLE, || beside(Some(with)))?;
                let from_ns = Monotonic.now_ns();
                look_after(half.saturating_sub(SETTLE), || beside(Some(with)))?;
                Ok([from_ns, Monotonic.now_ns()])
            };
            let (first, second) = (one(first_with)?, one(!first_with)?);
            times.push(in_order(first_with, first, second));
        }
        Ok(())
    })?;
    let halves = times.into_iter().map(|[without, with]| {
        Ok::<_, Box<dyn Error>>([Half::of(&ran, without)?, Half::of(&ran, with)?])
    });
    halves.collect()
}

/// Runs the graph for `seconds` with these further options.
///
/// # Errors
/// If the graph fails.
pub fn run(prepared: &Prepared, seconds: f64, options: &[&str]) -> Result<Half, Box<dyn Error>> {
    let ran = watched(prepared, seconds, options, |_| Ok(()))?;
    let first_ns = ran.cycles.first().map_or(0, |cycle| cycle.t_schedule_ns);
    Half::of(&ran, [first_ns + (WARM_UP_S * 1e9) as u64, u64::MAX])
}

/// Calls `look` again and again for so long.
fn look_after(
    lasts: Duration,
    mut look: impl FnMut() -> Result<(), Box<dyn Error>>,
) -> Result<(), Box<dyn Error>> {
    let until = Instant::now() + lasts;
    while Instant::now() < until {
        look()?;
        std::thread::sleep(LOOK.min(until.saturating_duration_since(Instant::now())));
    }
    Ok(())
}

/// Every instant that the reader knows of, and how many actions it has lost.
type Read = (Vec<Cycle>, u64);

/// A run of the graph, seen from outside.
struct Ran {
    cycles: Vec<Cycle>,
    misses: Vec<Miss>,
}

/// Runs the graph, its actions read by a light observer, while `beside` does its part once the
/// services are being started. `beside` is given a way to ask whether actions come.
fn watched(
    prepared: &Prepared,
    seconds: f64,
    options: &[&str],
    beside: impl FnOnce(&dyn Fn() -> bool) -> Result<(), Box<dyn Error>>,
) -> Result<Ran, Box<dyn Error>> {
    let setup = prepared.setup();
    let canaries = prepared.canaries(seconds + AROUND_S)?;
    let mut reader: Option<JoinHandle<Result<Read, String>>> = None;
    let period_ns = setup.period_ns();
    let summary = prepared.run_beside(seconds, options, || {
        prepared.wait_until_started()?;
        let (send, first) = channel();
        let place = setup.domain()?;
        reader = Some(std::thread::spawn(move || {
            read(&place, seconds, period_ns, &send).map_err(|e| e.to_string())
        }));
        beside(&|| first.try_recv().is_ok())
    })?;
    let reader = reader.ok_or("nobody has read the actions")?;
    let (cycles, lost) = reader.join().map_err(|_| "the reader has died")??;
    if lost > 0 {
        return Err(format!("the reader lost {lost} actions: what they ended is not known").into());
    }
    let seen: Vec<Seen> = canaries.into_iter().filter_map(Canary::finish).collect();
    let is_attributed = cell::check(&summary, &seen, &prepared.wanted())?;
    let believed = seen.iter().filter(|_| is_attributed);
    let records: Vec<Record<'_>> = believed.map(Record::of).collect();
    let misses = misses(&cycles, prepared.deadline_ns(), &records);
    Ok(Ran { cycles, misses })
}

/// Reads every action's stamps until the graph is gone, and sends word of the first; the cycles,
/// and how many were lost.
fn read(
    domain: &Domain,
    seconds: f64,
    period_ns: u64,
    first: &Sender<()>,
) -> Result<Read, Box<dyn Error>> {
    let _ = placement::apply(Wanted {
        core: 1,
        priority: READER_PRIORITY,
    });
    let until = Instant::now() + Duration::from_secs_f64(seconds + AROUND_S);
    let link = Link::join(domain, "reader")?;
    let graph = Graph::SharedMemory(link);
    let mut actions = graph.receiver::<Action>(Topic::Action)?;
    let (mut answered, mut lost, mut next) = (Vec::new(), 0, None);
    while domain.processes_file().exists() && Instant::now() < until {
        while actions.advance() {
            let Some(action) = actions.held() else { break };
            let header = action.header;
            lost += next.map_or(0, |next: u64| header.seq.saturating_sub(next));
            next = Some(header.seq + 1);
            if action.cause.kind() == Some(CauseKind::Frame) {
                if answered.is_empty() {
                    let _ = first.send(());
                }
                answered.push(CycleStamps {
                    t_schedule_ns: header.t_schedule_ns,
                    t_publish_ns: header.t_publish_ns,
                    ..CycleStamps::default()
                });
            }
        }
        std::thread::sleep(Duration::from_millis(4));
    }
    let cycles = of_stage(&answered, period_ns);
    Ok((cycles, lost))
}

/// Archives what pairs of runs have shown under `name`; `about` says what was run.
///
/// # Errors
/// The file system's.
pub fn archive(name: &str, about: &str, pairs: &[[Half; 2]]) -> Result<(), Box<dyn Error>> {
    let mut archive = Archive::new(name)?;
    archive.say(&format!(
        "{about}\n\nEnd to end, us, of {} interleaved pairs: without, then with. Missed: Vigil's \
         own, and the machine's.\n",
        pairs.len()
    ));
    archive.say(
        "| pair | p50 without | with | p99 without | with | missed without | with |\n\
         |---|---|---|---|---|---|---|",
    );
    let at = |half: &Half, q: f64| half.end_to_end.histogram().value_at_quantile(q) as f64 * 1e-3;
    let n = |half: &Half| half.end_to_end.histogram().len();
    let tail = |half: &Half| percentile(0.99, n(half), format!("{:.1}", at(half, 0.99)));
    for (i, [without, with]) in pairs.iter().enumerate() {
        archive.say(&format!(
            "| {} | {:.1} | {:.1} | {} | {} | {}, {} | {}, {} |",
            i + 1,
            at(without, 0.5),
            at(with, 0.5),
            tail(without),
            tail(with),
            without.ours,
            without.machine,
            with.ours,
            with.machine,
        ));
    }
    archive.say("");
    let has = |q: f64| {
        pairs
            .iter()
            .flatten()
            .all(|half| has_percentile(q, n(half)))
    };
    for q in [0.5, 0.99].into_iter().filter(|q| has(*q)) {
        let ratios: Vec<f64> = pairs.iter().map(|[a, b]| at(b, q) / at(a, q)).collect();
        let differences: Vec<f64> = pairs.iter().map(|[a, b]| at(b, q) - at(a, q)).collect();
        let (ratio, difference) = (median_ratio(&ratios), median_ratio(&differences));
        archive.say(&format!(
            "p{}: median ratio {:.3} ({:.3} to {:.3} with {:.1} % confidence), median difference \
             {:+.2} us ({:+.2} to {:+.2}).\n",
            q * 100.0,
            ratio.median,
            ratio.interval[0],
            ratio.interval[1],
            100.0 * ratio.confidence,
            difference.median,
            difference.interval[0],
            difference.interval[1],
        ));
    }
    let sum = |half: usize| pairs.iter().map(|pair| pair[half].ours).sum::<usize>();
    archive.say(&format!(
        "Missed by Vigil itself: {} without, {} with.",
        sum(0),
        sum(1)
    ));
    let half = |half: &Half| {
        json!({
            "end_to_end_us": us(&half.end_to_end), "missed": { "ours": half.ours,
            "machine": half.machine },
        })
    };
    let pair = |[a, b]: &[Half; 2]| json!({ "without": half(a), "with": half(b) });
    archive.store("pairs.json", &pairs.iter().map(pair).collect::<Value>())?;
    archive.close()?;
    Ok(())
}
