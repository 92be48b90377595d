//! Runs of the graph in interleaved pairs: with something and without, and what that costs.

use std::error::Error;
use std::process::Child;
use std::time::{Duration, Instant};

use serde_json::{Value, json};
use vigil_blocks::{Action, CauseKind};
use vigil_cycle::canary::Canary;
use vigil_cycle::placement::Wanted;
use vigil_cycle::port::Link;
use vigil_cycle::{CycleStamps, Domain, Graph, Latency, Topic, placement, signal};

use super::attribution::{Record, misses};
use super::cell::us;
use super::cycles::{Cycle, join};
use super::graph::Prepared;
use crate::archive::Archive;
use crate::pairs::median_ratio;

/// Actions at the start of a run that do not count, s.
const WARM_UP_S: f64 = 2.0;
/// Time beside the run in which canaries run, s.
const AROUND_S: f64 = 60.0;
/// The reader of the actions runs above ordinary processes and below the graph.
const READER_PRIORITY: u8 = 10;
/// Interval at which a run is looked after.
const LOOK: Duration = Duration::from_millis(50);

/// What one run showed.
#[derive(Debug)]
pub struct Half {
    /// From the schedule to the action.
    pub end_to_end: Latency,
    /// Misses of Vigil's own.
    pub ours: usize,
    /// The machine's.
    pub machine: usize,
    /// Actions that the reader lost.
    pub lost: u64,
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
        let first = one(first_with)?;
        let second = one(!first_with)?;
        all.push(if first_with {
            [second, first]
        } else {
            [first, second]
        });
    }
    Ok(all)
}

/// Runs the graph for `seconds` with these further options; calls `look_after` again and again once
/// its services are being started.
///
/// # Errors
/// If the graph fails, or `look_after` does.
pub fn run(
    prepared: &Prepared,
    seconds: f64,
    options: &[&str],
    mut look_after: impl FnMut() -> Result<(), Box<dyn Error>>,
) -> Result<Half, Box<dyn Error>> {
    let setup = prepared.setup();
    let canaries = prepared.canaries(seconds + AROUND_S)?;
    let mut launcher = Started(prepared.start(seconds, options)?);
    let reader = {
        let (domain, period_ns) = (setup.domain()?, setup.period_ns());
        std::thread::spawn(move || read(&domain, seconds, period_ns).map_err(|e| e.to_string()))
    };
    let domain = setup.domain()?;
    let status = loop {
        if let Some(status) = launcher.0.try_wait()? {
            break status;
        }
        // Not before the launcher has cleaned up and started its services.
        if domain.processes_file().exists() {
            look_after()?;
        }
        std::thread::sleep(LOOK);
    };
    if !status.success() {
        return Err(format!("the graph ended with {status}").into());
    }
    let (cycles, lost) = reader.join().map_err(|_| "the reader has died")??;
    let seen: Vec<_> = canaries.into_iter().filter_map(Canary::finish).collect();
    let records: Vec<Record<'_>> = seen.iter().map(Record::of).collect();
    let missed = misses(&cycles, prepared.deadline_ns(), &records);
    let machine = missed.iter().filter(|m| m.is_machine).count();
    let mut end_to_end = Latency::new()?;
    cycles
        .iter()
        .for_each(|c| end_to_end.record(c.end_to_end_ns()));
    Ok(Half {
        end_to_end,
        ours: missed.len() - machine,
        machine,
        lost,
    })
}

/// Reads every action's stamps until the graph is gone; the cycles, and how many were lost.
fn read(
    domain: &Domain,
    seconds: f64,
    period_ns: u64,
) -> Result<(Vec<Cycle>, u64), Box<dyn Error>> {
    let _ = placement::apply(Wanted {
        core: 1,
        priority: READER_PRIORITY,
    });
    let until = Instant::now() + Duration::from_secs_f64(seconds + 60.0);
    while !domain.processes_file().exists() {
        if Instant::now() > until {
            return Err("the graph did not start".into());
        }
        std::thread::sleep(Duration::from_millis(5));
    }
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
                answered.push(CycleStamps {
                    t_schedule_ns: header.t_schedule_ns,
                    t_publish_ns: header.t_publish_ns,
                    ..CycleStamps::default()
                });
            }
        }
        std::thread::sleep(Duration::from_millis(4));
    }
    let first_ns = answered.first().map_or(0, |s| s.t_schedule_ns);
    let from_ns = first_ns + (WARM_UP_S * 1e9) as u64;
    // Every instant of the schedule, those included that nothing answered in time.
    let stamps = [Vec::new(), Vec::new(), Vec::new(), answered];
    let cycles = join(&stamps, period_ns, from_ns);
    Ok((cycles, lost))
}

/// The launcher: stopped when dropped.
struct Started(Child);

impl Drop for Started {
    fn drop(&mut self) {
        if matches!(self.0.try_wait(), Ok(None)) {
            signal::terminate(self.0.id());
        }
        let _ = self.0.wait();
    }
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
    for (i, [without, with]) in pairs.iter().enumerate() {
        archive.say(&format!(
            "| {} | {:.1} | {:.1} | {:.1} | {:.1} | {}, {} | {}, {} |",
            i + 1,
            at(without, 0.5),
            at(with, 0.5),
            at(without, 0.99),
            at(with, 0.99),
            without.ours,
            without.machine,
            with.ours,
            with.machine,
        ));
    }
    archive.say("");
    for q in [0.5, 0.99] {
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
            "machine": half.machine }, "lost_by_the_reader": half.lost,
        })
    };
    let raw = pairs
        .iter()
        .map(|[a, b]| json!({ "without": half(a), "with": half(b) }));
    archive.store("pairs.json", &raw.collect::<Value>())?;
    println!("archived in {}", archive.close()?.display());
    Ok(())
}
