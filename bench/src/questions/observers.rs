//! Do slow, stopped or dead observers disturb the graph, and what does its instrumentation cost?
//!
//! Interleaved pairs: halves of one run with and without three bad observers (one that never drains
//! what it holds, one that is stopped, ones that are killed again and again), or runs with and
//! without the services' histograms and stamps. Latencies are read by a light observer from the
//! actions' own stamps, in both halves of a pair alike.

use std::error::Error;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use clap::ValueEnum;
use vigil_bench::latency::cycles::STAGES;
use vigil_bench::latency::graph::{Change, Prepared};
use vigil_bench::latency::halves::{self, Half};
use vigil_bench::latency::load::{Load, Running};
use vigil_bench::latency::recording;
use vigil_blocks::{Action, DetectionBelief, FaultBelief, ParticleBlock, SensorFrame};
use vigil_cycle::port::Link;
use vigil_cycle::{Graph, Topic, signal};
use vigil_setup::schema::Source;
use vigil_setup::{GraphArgs, Setup};

/// The word with which the program is a bad observer.
pub const OBSERVE_WORD: &str = "observe";
/// Interval at which an observer of the last kind is killed and another started.
const KILL_EVERY: Duration = Duration::from_secs(2);

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
#[derive(Debug, clap::Args)]
pub struct Args {
    /// What the halves of a pair differ in.
    #[arg(long, default_value = "observers")]
    difference: Difference,
    /// Pairs.
    #[arg(long, value_name = "N", default_value_t = 10)]
    pairs: usize,
    /// Time of each half, s.
    #[arg(long, value_name = "S", default_value_t = 60.0)]
    seconds: f64,
    /// Rate of the schedule, Hz.
    #[arg(long, value_name = "HZ", default_value_t = 1000.0)]
    rate: f64,
    /// Load beside the graph.
    #[arg(long, default_value = "keep-awake")]
    load: Load,
}

/// Is a bad observer of the graph of this file: opens every topic, takes what it may hold, and
/// never lets go. It leaves a file in `folder` once it holds a frame.
pub fn observe(config: &Path, folder: &Path) -> Result<(), Box<dyn Error>> {
    let setup = GraphArgs {
        config: config.to_owned(),
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

/// Answers the question.
pub fn run(args: &Args) -> Result<(), Box<dyn Error>> {
    let pairs = vigil_bench::in_folder("observers", |folder| measure(args, folder))?;
    let name = match args.difference {
        Difference::Observers => "observers",
        Difference::Instruments => "instrumentation",
    };
    let (n, seconds, rate, load) = (args.pairs, args.seconds, args.rate, args.load.name());
    let difference = args.difference.to_possible_value();
    let difference = difference.map_or_else(String::new, |v| v.get_name().to_owned());
    let mut about = format!(
        "`scripts/bench observers --difference {difference} --pairs {n} --seconds {seconds} --rate \
         {rate} --load {load}`"
    );
    if args.difference == Difference::Instruments {
        let cycle_ns = recording::cycle_ns()?;
        let stages = STAGES as f64;
        about.push_str(&format!(
            "\n\nBy itself, recording a cycle takes a service {cycle_ns:.0} ns (three histograms \
             and the stamps, median of batches): {:.2} us for all {stages} of them.",
            1e-3 * stages * cycle_ns,
        ));
    }
    halves::archive(name, &about, &pairs)
}

fn measure(args: &Args, folder: &Path) -> Result<Vec<[Half; 2]>, Box<dyn Error>> {
    let change = Change {
        rate_hz: args.rate,
        particles: 1000,
        is_fifo: true,
        source: Source::Simulator,
        is_faulty: false,
    };
    let prepared = Prepared::new(change, folder)?;
    let load = Running::start(args.load, &prepared.cores(), folder, Some(prepared.path()))?;
    let pairs = match args.difference {
        Difference::Observers => observed(args, &prepared, folder),
        Difference::Instruments => halves::interleaved(args.pairs, |with| {
            let recorded = folder.display().to_string();
            let with: &[&str] = if with {
                &["--stamps", &recorded]
            } else {
                &["--no-timing"]
            };
            let half = halves::run(&prepared, args.seconds, with)?;
            prepared.setup().domain()?.remove_residue();
            Ok(half)
        }),
    };
    load.finish()?;
    pairs
}

/// Halves of one run, with bad observers and without.
fn observed(
    args: &Args,
    prepared: &Prepared,
    folder: &Path,
) -> Result<Vec<[Half; 2]>, Box<dyn Error>> {
    let (mut bad, mut attached): (Option<Bad<'_>>, Vec<usize>) = (None, Vec::new());
    let pairs = halves::alternating(prepared, (args.pairs, args.seconds), |with| {
        if with == Some(true) {
            let bad = bad.get_or_insert_with(|| Bad::new(prepared.path(), folder));
            return bad.keep_up();
        }
        if let Some(bad) = bad.take() {
            attached.push(bad.attached()?);
        }
        Ok(())
    })?;
    // The last half may have been one with them.
    if let Some(bad) = bad.take() {
        attached.push(bad.attached()?);
    }
    prepared.setup().domain()?.remove_residue();
    match attached.iter().min() {
        Some(3..) => Ok(pairs),
        least => Err(format!("only {least:?} bad observers saw the graph in a half").into()),
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
            signal::hold(stopped.id());
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
