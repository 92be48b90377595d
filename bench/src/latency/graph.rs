//! The graph itself, started as a user starts it.

use std::error::Error;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use super::canary::Canary;
use serde_json::Value;
use toml::Table;
use vigil_cycle::placement::PlacementRequest;
use vigil_cycle::serve::Leave;
use vigil_cycle::topic::ServiceName;
use vigil_cycle::{CycleStamps, PortError, stamps};
use vigil_setup::Setup;

use crate::chain::{STAGE_NAMES, STAGES};
use crate::{find_models, program, root};

/// What is changed in the default graph.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Change {
    /// Rate of the schedule, Hz.
    pub rate_hz: f64,
    /// Most hypotheses of the identifier, or its particles.
    pub particles: usize,
    /// True for `SCHED_FIFO` where permitted, false for `SCHED_OTHER`.
    pub is_fifo: bool,
    /// True if the hierarchical filter identifies, with all its particles, and a wheel sticks.
    pub is_faulty: bool,
}

/// Time that the services may take to start, s: under context switches it is minutes.
const START_S: f64 = 240.0;

/// What breaks in a graph that is to have a fault, before any warm-up ends.
const FAULT: &str = "stuck:RM@1";

/// A graph file for measuring.
#[derive(Debug)]
pub struct GraphFile {
    path: PathBuf,
    launcher: PathBuf,
    setup: Setup,
    is_faulty: bool,
}

/// What a run of the graph left.
#[derive(Debug)]
pub struct GraphRun {
    /// The launcher's document.
    pub summary: Value,
    /// Stamps of each service's cycles; none of a service that the graph does without.
    pub stamps: [Vec<CycleStamps>; STAGES],
}

impl GraphFile {
    /// The default graph with this change, written to `folder`.
    ///
    /// # Errors
    /// If the default graph cannot be read, or the changed one is refused.
    pub fn new(change: Change, folder: &Path) -> Result<Self, Box<dyn Error>> {
        let config = root().join("config");
        let text = std::fs::read_to_string(config.join("rover.toml"))?;
        let mut file: Table = text.parse()?;
        set(&mut file, "graph", "rate_hz", change.rate_hz.into())?;
        let name = format!("bench-{}", std::process::id());
        set(&mut file, "graph", "name", name.into())?;
        let particles = i64::try_from(change.particles)?;
        set(&mut file, "identifier", "particles", particles.into())?;
        if change.is_faulty {
            set(&mut file, "identifier", "filter", "hierarchical".into())?;
        }
        find_models(&mut file)?;
        let recordings = folder.join("recordings").display().to_string();
        let mut blackbox = Table::new();
        blackbox.insert("folder".into(), recordings.into());
        file.insert("blackbox".into(), blackbox.into());
        if !change.is_fifo {
            for service in STAGE_NAMES {
                let services = file.get_mut("services").and_then(|s| s.get_mut(service));
                let service = services.and_then(toml::Value::as_table_mut);
                let service = service.ok_or("no such service")?;
                service.insert("priority".into(), 0_i64.into());
            }
        }
        let path = folder.join("graph.toml");
        std::fs::write(&path, file.to_string())?;
        let setup = crate::load(path.clone())?;
        let is_faulty = change.is_faulty;
        Ok(Self {
            path,
            launcher: program("vigil-launcher")?,
            setup,
            is_faulty,
        })
    }

    /// The checked configuration.
    #[must_use]
    pub const fn setup(&self) -> &Setup {
        &self.setup
    }

    /// Core and priority of each stage.
    #[must_use]
    pub fn wanted(&self) -> [PlacementRequest; STAGES] {
        ServiceName::ALL.map(|name| {
            let service = self.setup.service(name);
            PlacementRequest {
                core: service.core,
                priority: service.priority,
            }
        })
    }

    /// Cores of the services, each once.
    #[must_use]
    pub fn cores(&self) -> Vec<usize> {
        let mut cores = self.wanted().map(|w| w.core).to_vec();
        cores.sort_unstable();
        cores.dedup();
        cores
    }

    /// Deadline of the last stage after the schedule, ns.
    #[must_use]
    pub fn deadline_ns(&self) -> u64 {
        self.stage_deadline_ns(STAGES - 1)
    }

    /// Deadline of a stage after the schedule, ns.
    #[must_use]
    pub fn stage_deadline_ns(&self, stage: usize) -> u64 {
        let plan = self.setup.plan(ServiceName::ALL[stage], Leave::default());
        plan.schedule.deadline_ns
    }

    /// A canary on each core, one priority above what runs there, with room for every wake-up of
    /// `seconds`.
    ///
    /// # Errors
    /// If one cannot be started.
    pub fn canaries(&self, seconds: f64) -> Result<Vec<Canary>, PortError> {
        let highest = self.wanted().iter().map(|w| w.priority).max().unwrap_or(0);
        let priority = highest.max(1) + 1;
        let period_ns = (self.setup.period_ns() / 8).clamp(100_000, 1_000_000);
        let capacity = (seconds * 1e9 / period_ns as f64).ceil() as usize;
        let start = |core| Canary::start(PlacementRequest { core, priority }, period_ns, capacity);
        self.cores().into_iter().map(start).collect()
    }

    /// Text of the graph file, its paths relative to the project's folder.
    ///
    /// # Errors
    /// The file system's.
    pub fn text(&self) -> std::io::Result<String> {
        let text = std::fs::read_to_string(&self.path)?;
        Ok(text.replace(&format!("{}/", root().display()), ""))
    }

    /// Where the graph file lies.
    #[must_use]
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Runs it for `seconds`; its services leave their stamps, by way of `folder`.
    ///
    /// # Errors
    /// If the graph fails or leaves no stamps.
    pub fn run(&self, seconds: f64, folder: &Path) -> Result<GraphRun, Box<dyn Error>> {
        let mut command = self.command(seconds, folder);
        command.args(["--duration", &seconds.to_string()]);
        if self.is_faulty {
            command.args(["--inject", FAULT]);
        }
        let output = command.output()?;
        if !output.status.success() {
            let text = String::from_utf8_lossy(&output.stderr);
            return Err(format!("the graph ended with {}\n{text}", output.status).into());
        }
        GraphRun::read(&output.stdout, folder)
    }

    /// Its launcher, to be started: without a black box, and with room for the stamps of `seconds`.
    /// What it prints at the end is for [`GraphRun::read`].
    #[must_use]
    pub fn command(&self, seconds: f64, folder: &Path) -> Command {
        let rate_hz = self.setup.file.graph.rate_hz;
        let kept = ((seconds + START_S) * rate_hz).ceil();
        let mut command = Command::new(&self.launcher);
        command
            .arg("--config")
            .arg(&self.path)
            .arg("--stamps")
            .arg(folder);
        command.args(["--stamped-cycles", &kept.to_string()]);
        // What the black box costs is a measurement of its own.
        command.args(["--json", "--no-blackbox"]);
        command.stdin(Stdio::null());
        command
    }
}

impl GraphRun {
    /// From what the launcher has printed, and from the stamps in `folder`, which are gone then.
    ///
    /// # Errors
    /// If there are none.
    pub fn read(printed: &[u8], folder: &Path) -> Result<Self, Box<dyn Error>> {
        let summary: Value = serde_json::from_slice(printed)?;
        let read = |stage: usize| {
            if summary["services"].get(STAGE_NAMES[stage]).is_none() {
                return Ok(Vec::new());
            }
            let path = folder.join(format!("{}.stamps", STAGE_NAMES[stage]));
            let found = stamps::read(&path);
            let _ = std::fs::remove_file(&path);
            found
        };
        let stamps = [read(0)?, read(1)?, read(2)?, read(3)?];
        Ok(Self { summary, stamps })
    }
}

fn set(file: &mut Table, table: &str, key: &str, value: toml::Value) -> Result<(), String> {
    let table = file.get_mut(table).and_then(toml::Value::as_table_mut);
    let table = table.ok_or_else(|| format!("the default graph has no table for {key}"))?;
    table.insert(key.to_owned(), value);
    Ok(())
}
