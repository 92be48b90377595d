//! Do slow, stopped or dead observers disturb the graph? And what does its own instrumentation
//! cost?
//!
//! Interleaved pairs of runs: with and without three bad observers (one that never drains what it
//! holds, one that is stopped, ones that are killed again and again), or with and without the
//! services' histograms and stamps. Latencies are read by a light observer from the actions' own
//! stamps, in both halves of a pair alike.

use std::error::Error;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, ExitCode, Stdio};
use std::time::{Duration, Instant};

use clap::{Parser, ValueEnum};
use serde_json::{Value, json};
use vigil_bench::archive::Archive;
use vigil_bench::latency::attribution::{Record, misses};
use vigil_bench::latency::cell::us;
use vigil_bench::latency::cycles::{Cycle, join};
use vigil_bench::latency::flood::{FLOOD_WORD, be_flood};
use vigil_bench::latency::graph::{Change, Prepared};
use vigil_bench::latency::load::{Load, Running};
use vigil_bench::pairs::median_ratio;
use vigil_blocks::{Action, CauseKind, DetectionBelief, FaultBelief, ParticleBlock, SensorFrame};
use vigil_cycle::canary::Canary;
use vigil_cycle::placement::Wanted;
use vigil_cycle::port::Link;
use vigil_cycle::{CycleStamps, Domain, Graph, Latency, Topic, placement, signal};
use vigil_setup::{GraphArgs, Setup};

/// First argument of a process that is a bad observer.
const OBSERVE_WORD: &str = "observe";
/// Actions at the start of a run that do not count, s.
const WARM_UP_S: f64 = 2.0;
/// Interval at which an observer of the last kind is killed and another started.
const KILL_EVERY: Duration = Duration::from_secs(2);
/// Late wake-ups of a canary that are kept.
const CANARY_KEPT: usize = 1_000_000;
/// The reader of the actions runs above ordinary processes and below the graph.
const READER_PRIORITY: u8 = 10;

/// What the halves of a pair differ in.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
#[value(rename_all = "kebab-case")]
enum Difference {
    /// Bad observers.
    Observers,
    /// Histograms and stamps.
    Instruments,
}

/// Measures in interleaved pairs.
#[derive(Debug, Parser)]
#[command(name = "scripts/bench observers")]
struct Args {
    /// What the halves of a pair differ in.
    #[arg(long, default_value = "observers")]
    difference: Difference,
    /// Pairs.
    #[arg(long, value_name = "N", default_value_t = 10)]
    pairs: usize,
    /// Time of each run, s.
    #[arg(long, value_name = "S", default_value_t = 60.0)]
    seconds: f64,
    /// Rate of the schedule, Hz.
    #[arg(long, value_name = "HZ", default_value_t = 1000.0)]
    rate: f64,
    /// Load beside the graph.
    #[arg(long, default_value = "keep-awake")]
    load: Load,
}

fn main() -> ExitCode {
    let words: Vec<String> = std::env::args().skip(1).collect();
    if words.first().is_some_and(|word| word == OBSERVE_WORD) {
        return vigil_bench::ended("observer", observe(words.get(1), words.get(2)));
    }
    if words.first().is_some_and(|word| word == FLOOD_WORD) {
        return vigil_bench::ended("flood", be_flood(words.get(1)));
    }
    let args = Args::parse();
    vigil_bench::ended("observers", run(&args))
}

/// Is a bad observer: opens every topic, takes what it may hold, and never lets go.
fn observe(config: Option<&String>, folder: Option<&String>) -> Result<(), Box<dyn Error>> {
    let config = PathBuf::from(config.ok_or("no graph file is given")?);
    let folder = PathBuf::from(folder.ok_or("no folder is given")?);
    let setup = GraphArgs {
        config,
        ..GraphArgs::default()
    }
    .load()?;
    signal::install();
    let graph = graph_of(&setup, "slow")?;
    let mut frames = graph.receiver::<SensorFrame>(Topic::Sensor)?;
    let mut detections = graph.receiver::<DetectionBelief>(Topic::Detection)?;
    let mut particles = graph.receiver::<ParticleBlock>(Topic::DetectionParticles)?;
    let mut beliefs = graph.receiver::<FaultBelief>(Topic::Diagnosis)?;
    let mut others = graph.receiver::<ParticleBlock>(Topic::DiagnosisParticles)?;
    let mut actions = graph.receiver::<Action>(Topic::Action)?;
    while !signal::stop_requested() {
        // Once: afterwards its queues are full for ever.
        if frames.held().is_none() {
            if frames.advance() {
                std::fs::write(folder.join(std::process::id().to_string()), "")?;
            }
            detections.advance();
            particles.advance();
            beliefs.advance();
            others.advance();
            actions.advance();
        }
        std::thread::sleep(Duration::from_millis(20));
    }
    Ok(())
}

fn graph_of(setup: &Setup, name: &str) -> Result<Graph, Box<dyn Error>> {
    let domain = setup.domain()?;
    Ok(Graph::SharedMemory(Link::join(&domain, name)?))
}

/// What one run showed.
struct Half {
    end_to_end: Latency,
    ours: usize,
    machine: usize,
    lost: u64,
}

fn run(args: &Args) -> Result<(), Box<dyn Error>> {
    let folder = std::env::temp_dir().join(format!("vigil-observers-{}", std::process::id()));
    std::fs::create_dir_all(&folder)?;
    let result = measure(args, &folder);
    let _ = std::fs::remove_dir_all(&folder);
    let pairs = result?;
    report(args, &pairs)
}

fn measure(args: &Args, folder: &Path) -> Result<Vec<[Half; 2]>, Box<dyn Error>> {
    let change = Change {
        rate_hz: args.rate,
        particles: 1000,
        is_fifo: true,
    };
    let prepared = Prepared::new(change, folder)?;
    let graph = Some(prepared.path());
    let _load = Running::start(args.load, &prepared.cores(), folder, graph)?;
    let mut pairs = Vec::new();
    for pair in 0..args.pairs {
        eprintln!("pair {} of {}", pair + 1, args.pairs);
        // The order changes from pair to pair: a drift of the machine falls on both alike.
        let first_with = pair % 2 == 1;
        let one = half(args, &prepared, (first_with, folder))?;
        let two = half(args, &prepared, (!first_with, folder))?;
        pairs.push(if first_with { [two, one] } else { [one, two] });
    }
    Ok(pairs)
}

/// One run; `with` what makes the difference or without.
fn half(
    args: &Args,
    prepared: &Prepared,
    (with, folder): (bool, &Path),
) -> Result<Half, Box<dyn Error>> {
    let setup = prepared.setup();
    let canaries = prepared.canaries(CANARY_KEPT)?;
    let recorded = folder.display().to_string();
    let options: &[&str] = match args.difference {
        Difference::Observers => &[],
        Difference::Instruments if with => &["--stamps", &recorded],
        Difference::Instruments => &["--no-timing"],
    };
    let mut launcher = Started(prepared.start(args.seconds, options)?);
    let reader = {
        let (domain, seconds, period_ns) = (setup.domain()?, args.seconds, setup.period_ns());
        std::thread::spawn(move || read(&domain, seconds, period_ns).map_err(|e| e.to_string()))
    };
    let mut bad = Bad::new(prepared.path(), folder);
    let domain = setup.domain()?;
    let status = loop {
        if let Some(status) = launcher.0.try_wait()? {
            break status;
        }
        // Not before the launcher has cleaned up and started its services.
        let is_up = domain.processes_file().exists();
        if with && is_up && args.difference == Difference::Observers {
            bad.keep_up()?;
        }
        std::thread::sleep(Duration::from_millis(50));
    };
    if !status.success() {
        return Err(format!("the graph ended with {status}").into());
    }
    let attached = bad.attached()?;
    drop(bad);
    if with && args.difference == Difference::Observers && attached < 3 {
        return Err(format!("only {attached} bad observers saw the graph").into());
    }
    domain.remove_residue();
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

/// Bad observers of a run: ended when dropped.
struct Bad<'a> {
    config: &'a Path,
    /// Where each leaves a file once it holds a block.
    folder: PathBuf,
    slow: Option<Child>,
    stopped: Option<Child>,
    killed: Option<(Child, Instant)>,
}

impl<'a> Bad<'a> {
    fn new(config: &'a Path, folder: &Path) -> Self {
        Self {
            config,
            folder: folder.join("attached"),
            slow: None,
            stopped: None,
            killed: None,
        }
    }

    fn spawn(&self) -> std::io::Result<Child> {
        Command::new(std::env::current_exe()?)
            .arg(OBSERVE_WORD)
            .arg(self.config)
            .arg(&self.folder)
            .stdin(Stdio::null())
            .spawn()
    }

    /// Observers that have held a block.
    fn attached(&self) -> std::io::Result<usize> {
        if !self.folder.exists() {
            return Ok(0);
        }
        let count = std::fs::read_dir(&self.folder)?.count();
        std::fs::remove_dir_all(&self.folder)?;
        Ok(count)
    }

    fn keep_up(&mut self) -> Result<(), Box<dyn Error>> {
        std::fs::create_dir_all(&self.folder)?;
        if self.slow.is_none() {
            self.slow = Some(self.spawn()?);
            self.stopped = Some(self.spawn()?);
            self.killed = Some((self.spawn()?, Instant::now()));
        }
        let Some((child, since)) = &mut self.killed else {
            return Ok(());
        };
        if since.elapsed() < KILL_EVERY {
            return Ok(());
        }
        child.kill()?;
        child.wait()?;
        if let Some(stopped) = &self.stopped {
            // Harmless the second time.
            let pid = stopped.id().to_string();
            Command::new("kill").args(["-STOP", &pid]).status()?;
        }
        self.killed = Some((self.spawn()?, Instant::now()));
        Ok(())
    }
}

impl Drop for Bad<'_> {
    fn drop(&mut self) {
        let killed = self.killed.take().map(|(child, _)| child);
        for mut child in [self.slow.take(), self.stopped.take(), killed]
            .into_iter()
            .flatten()
        {
            let _ = child.kill();
            let _ = child.wait();
        }
    }
}

fn report(args: &Args, pairs: &[[Half; 2]]) -> Result<(), Box<dyn Error>> {
    let name = match args.difference {
        Difference::Observers => "observers",
        Difference::Instruments => "instrumentation",
    };
    let mut archive = Archive::new(name)?;
    let (n, seconds, rate, load) = (args.pairs, args.seconds, args.rate, args.load.name());
    let difference = args.difference.to_possible_value();
    let difference = difference.map_or_else(String::new, |v| v.get_name().to_owned());
    archive.say(&format!(
        "`scripts/bench observers --difference {difference} --pairs {n} --seconds {seconds} --rate \
         {rate} --load {load}`\n\nEnd to end, us, of {n} interleaved pairs: without, then with. \
         Missed: Vigil's own, and the machine's.\n"
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
