//! `vigil check`: says before a start what will not work, and why.

use std::error::Error;
use std::fs;
use std::path::Path;

use schemars::JsonSchema;
use serde::Serialize;
use vigil_blocks::{
    Action, CheckpointPart, Control, DetectionBelief, FaultBelief, Faults, Health, Journal,
    ParticleBlock, SensorFrame, Truth,
};
use vigil_cycle::Topic;
use vigil_cycle::domain::shared_memory_free_bytes;
use vigil_cycle::placement::{self, Placement, PlacementRequest};
use vigil_cycle::topic::ServiceName;
use vigil_recording::frames;
use vigil_setup::graph_file::Source;
use vigil_setup::{GraphArgs, Setup};

use crate::findings::{self, Finding, Status};
use vigil_terminal::output;
use vigil_terminal::{CommandError, Outcome};

/// Checks before a start whether this machine can run the graph.
///
/// It looks at the configuration, cores, scheduling rights, memory lock, shared memory, files left
/// behind by an earlier graph, and the kind of build.
#[derive(Debug, clap::Args)]
pub struct Args {
    #[command(flatten)]
    graph: GraphArgs,
    /// Print one JSON document.
    #[arg(long)]
    json: bool,
}

/// What it prints with --json.
#[derive(Debug, Serialize, JsonSchema)]
pub struct Document<'a> {
    /// Version of this document.
    schema_version: u32,
    /// False if something would not work.
    ok: bool,
    /// What was looked at.
    findings: &'a [Finding],
}

/// Checks everything that a start depends on; outcome `Failed` if something would not work.
///
/// # Errors
/// A configuration that is refused.
pub fn run(args: &Args) -> Result<Outcome, CommandError> {
    let setup = args.graph.load().map_err(CommandError::usage)?;
    let mut findings = vec![configuration(&setup), models(&setup)];
    findings.extend(cores(&setup));
    findings.push(scheduling(&setup));
    findings.extend([
        memory_lock(),
        throttling(),
        preemption(),
        shared_memory(&setup),
    ]);
    findings.push(blackbox(&setup));
    findings.push(residue(&setup));
    findings.push(build());
    let ok = findings::have_no_failure(&findings);
    if args.json {
        let document = Document {
            schema_version: 1,
            ok,
            findings: &findings,
        };
        output::json(&document).map_err(CommandError::failure)?;
    } else {
        findings::print(&findings)?;
    }
    Ok(if ok { Outcome::Done } else { Outcome::Failed })
}

fn finding(check: &'static str, status: Status, detail: impl Into<String>) -> Finding {
    Finding::new(check, status, detail)
}

fn configuration(setup: &Setup) -> Finding {
    let (path, hash) = (setup.path.display(), setup.hash);
    finding(
        "configuration",
        Status::Ok,
        format!("{path}, hash {hash:016x}"),
    )
}

/// Lets each service assemble what it runs on.
fn models(setup: &Setup) -> Finding {
    let assembled = || -> Result<(), Box<dyn Error>> {
        let sensor = &setup.file.sensor;
        if sensor.source != Source::External {
            vigil_sensor_sim::assemble(setup, &[])?;
        }
        if let (Source::Playback, Some(frames)) = (sensor.source, &sensor.frames) {
            let runs = frames::read(&setup.resolve(frames), &setup.robot)?;
            frames::playback_rate_hz(&runs, sensor.speed.unwrap_or(1.0))?;
        }
        vigil_detector::assemble(setup)?;
        vigil_identifier::assemble(setup)?;
        vigil_supervisor::assemble(setup)?;
        Ok(())
    };
    match assembled() {
        Ok(()) => {
            let (model, decision) = (setup.model_path.display(), setup.decision_path.display());
            finding("models", Status::Ok, format!("{model}, {decision}"))
        }
        Err(error) => finding("models", Status::Failure, error.to_string()),
    }
}

/// Which service is to run where. That the cores exist was checked with the configuration.
fn cores(setup: &Setup) -> Vec<Finding> {
    let isolated = fs::read_to_string("/sys/devices/system/cpu/isolated").unwrap_or_default();
    let mut used: Vec<usize> = ServiceName::ALL
        .iter()
        .map(|&name| setup.service(name).core)
        .collect();
    used.sort_unstable();
    used.dedup();
    used.iter()
        .map(|&core| {
            let names: Vec<&str> = ServiceName::ALL
                .iter()
                .filter(|&&name| setup.service(name).core == core)
                .map(|name| name.as_str())
                .collect();
            let shared = if names.len() > 1 { ", shared" } else { "" };
            let isolated = match isolated.trim() {
                "" => ", not isolated",
                _ => "",
            };
            let detail = format!("core {core}: {}{shared}{isolated}", names.join(", "));
            let alone = names.len() == 1;
            finding(
                "core",
                if alone { Status::Ok } else { Status::Warning },
                detail,
            )
        })
        .collect()
}

/// Tries the placement on a thread of its own, which ends with it.
fn trial(core: usize, priority: u8) -> Option<Placement> {
    std::thread::spawn(move || placement::apply(PlacementRequest { core, priority }))
        .join()
        .ok()
}

fn scheduling(setup: &Setup) -> Finding {
    let service = setup.service(ServiceName::SensorSim);
    let got = trial(service.core, service.priority);
    let text = got.map_or_else(String::new, |p| Placement::scheduling(p.policy, p.priority));
    match got {
        Some(p) if !p.pinned || p.core != service.core => {
            let detail = format!("asked for core {}, got {}", service.core, p.core);
            finding("scheduling", Status::Failure, detail)
        }
        Some(_) if text.starts_with("fifo") => finding("scheduling", Status::Ok, text),
        _ => finding(
            "scheduling",
            Status::Warning,
            "SCHED_FIFO is not permitted (CAP_SYS_NICE or rtprio limit): expect late cycles",
        ),
    }
}

fn memory_lock() -> Finding {
    if trial(0, 1).is_some_and(|p| p.memory_locked) {
        finding("memory lock", Status::Ok, "permitted")
    } else {
        let detail = "not permitted (CAP_IPC_LOCK or memlock limit): page faults may delay cycles";
        finding("memory lock", Status::Warning, detail)
    }
}

fn throttling() -> Finding {
    let read = |name: &str| {
        let text = fs::read_to_string(format!("/proc/sys/kernel/{name}")).ok()?;
        text.trim().parse::<i64>().ok()
    };
    match (read("sched_rt_runtime_us"), read("sched_rt_period_us")) {
        (Some(runtime), Some(period)) if runtime >= 0 && runtime < period => {
            let detail = format!("real-time tasks may use {runtime} of {period} us per core");
            finding("rt throttling", Status::Ok, detail)
        }
        (Some(_), Some(_)) => finding("rt throttling", Status::Ok, "off"),
        _ => finding("rt throttling", Status::Warning, "cannot be read"),
    }
}

fn preemption() -> Finding {
    let version = fs::read_to_string("/proc/version").unwrap_or_default();
    let kernel = version
        .split_whitespace()
        .nth(2)
        .unwrap_or("unknown")
        .to_owned();
    if version.contains("PREEMPT_RT") {
        return finding("kernel", Status::Ok, format!("{kernel}, PREEMPT_RT"));
    }
    let detail = format!("{kernel}, not PREEMPT_RT: no hard real-time claim can be made");
    finding("kernel", Status::Warning, detail)
}

fn shared_memory(setup: &Setup) -> Finding {
    let queues = setup.file.transport;
    let frames = queues.for_topic(Topic::Sensor);
    let frames = frames.reserved_bytes(size_of::<SensorFrame>() + size_of::<Truth>());
    let sizes = [
        size_of::<DetectionBelief>(),
        2 * size_of::<ParticleBlock>(),
        size_of::<FaultBelief>(),
        size_of::<Action>() + size_of::<Faults>(),
        ServiceName::ALL.len() * (size_of::<Health>() + size_of::<Control>()),
        ServiceName::STEPPING.len() * (size_of::<Journal>() + size_of::<CheckpointPart>()),
    ];
    let others = sizes.iter().map(|&size| queues.reserved_bytes(size));
    let need = frames + others.sum::<u64>();
    let mib = |bytes: u64| bytes >> 20;
    match shared_memory_free_bytes() {
        Some(free) if free >= 2 * need => {
            let detail = format!("{} MiB free, {} MiB needed", mib(free), mib(need));
            finding("shared memory", Status::Ok, detail)
        }
        Some(free) => {
            let detail = format!("{} MiB free, twice {} MiB are wanted", mib(free), mib(need));
            finding("shared memory", Status::Failure, detail)
        }
        None => finding("shared memory", Status::Failure, "/dev/shm cannot be used"),
    }
}

/// What the black box takes, and where its recordings go.
fn blackbox(setup: &Setup) -> Finding {
    let settings = &setup.file.blackbox;
    if !settings.enabled {
        return finding(
            "black box",
            Status::Warning,
            "blackbox.enabled is false: nothing is kept",
        );
    }
    let graph = &setup.file.graph;
    let detail = format!(
        "{} MiB of memory (three times that while killed ones are unwritten), {:.0} s at {} Hz; \
         at most {} MiB of recordings",
        settings.memory_mib,
        settings.memory_s(graph.rate_hz),
        graph.rate_hz,
        settings.folder_mib,
    );
    let folders = settings.folders(&setup.path, &graph.name);
    let is_short = settings.memory_s(graph.rate_hz) < settings.before_s;
    match folders.iter().find(|folder| can_be_written(folder)) {
        Some(folder) if is_short => {
            let detail = format!(
                "{detail} in {}; blackbox.before_s asks for {} s: raise blackbox.memory_mib",
                folder.display(),
                settings.before_s,
            );
            finding("black box", Status::Warning, detail)
        }
        Some(folder) => {
            let detail = format!("{detail} in {}", folder.display());
            finding("black box", Status::Ok, detail)
        }
        None => {
            let detail = format!("{detail}; no folder for them can be written");
            finding("black box", Status::Warning, detail)
        }
    }
}

/// True if a file can be made in the folder, or in the nearest that is there; nothing is left.
fn can_be_written(folder: &Path) -> bool {
    let nearest = folder.ancestors().find(|folder| folder.is_dir());
    nearest.is_some_and(|nearest| {
        let probe = nearest.join(format!(".probe-{}", std::process::id()));
        let is_made = fs::File::create(&probe).is_ok();
        let _ = fs::remove_file(probe);
        is_made
    })
}

fn residue(setup: &Setup) -> Finding {
    let domain = match setup.domain() {
        Ok(domain) => domain,
        Err(error) => return finding("residue", Status::Failure, error.to_string()),
    };
    match domain.lock() {
        Ok(None) => {
            let detail = format!("graph '{}' is running", domain.graph());
            finding("residue", Status::Warning, detail)
        }
        Ok(Some(_)) => match domain.residue().len() {
            0 => finding("residue", Status::Ok, "none"),
            n => {
                let detail = format!("{n} files of a dead graph; the next start removes them");
                finding("residue", Status::Warning, detail)
            }
        },
        Err(error) => finding("residue", Status::Failure, error.to_string()),
    }
}

fn build() -> Finding {
    if cfg!(debug_assertions) {
        finding(
            "build",
            Status::Warning,
            "debug build: latencies mean nothing",
        )
    } else {
        finding("build", Status::Ok, "release")
    }
}
