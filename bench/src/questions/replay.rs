//! Is a recording of ten minutes with five faults computed again bit by bit, and how fast?
//!
//! The graph runs as a user starts it, `vigil record` writes all of it, and `vigil replay --verify`
//! computes it again once the graph has ended.

use std::error::Error;
use std::path::Path;
use std::process::{Command, Output};

use serde_json::{Value, json};
use vigil_bench::archive::{Archive, Outlet};
use vigil_bench::latency::graph::{Change, GraphFile};
use vigil_bench::launched::Launched;
use vigil_bench::program;
use vigil_robot::FaultTree;

/// Least factor at which it is to be computed.
const FACTOR_MIN: f64 = 20.0;
/// Rate of the graph, Hz.
const RATE_HZ: f64 = 100.0;
/// Length of the recording, s: ten minutes, and the time until the first state.
const RECORDED_S: f64 = 615.0;
/// Time around it for which the graph's stamps have room, s.
const AROUND_S: f64 = 20.0;
/// How many faults are to be told.
const FAULTS_TOLD: usize = 5;
/// What breaks, and when it is mended, s after the start.
const FAULTS: [&str; 9] = [
    "stuck:RM@60",
    "clear:all@150",
    "encoder:LF:zero@180",
    "clear:all@270",
    "stuck:LR@300",
    "clear:all@390",
    "encoder:RR:frozen@420",
    "clear:all@500",
    "stuck:LM@520",
];

/// Measures how a recording is computed again.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Print the result as one JSON document, archive nothing.
    #[arg(long)]
    json: bool,
}

/// Answers the question.
pub fn run(args: &Args) -> Result<(), Box<dyn Error>> {
    let document = vigil_bench::in_folder("replay", measure)?;
    archive(&document, Outlet::by_flag(args.json))?;
    match document["is_met"] == true {
        true => Ok(()),
        false => Err("too few faults, or not computed again as it was, or too slowly".into()),
    }
}

fn measure(folder: &Path) -> Result<Value, Box<dyn Error>> {
    let graph = GraphFile::new(
        Change {
            rate_hz: RATE_HZ,
            particles: 1000,
            is_fifo: true,
            is_faulty: false,
        },
        folder,
    )?;
    let recording = folder.join("five-faults.mcap");
    let mut launcher = graph.command(RECORDED_S + AROUND_S, folder);
    for fault in FAULTS {
        launcher.args(["--inject", fault]);
    }
    let launched = Launched::start(&graph, launcher, folder)?;
    eprintln!("recording {RECORDED_S} s");
    record(&graph, &recording)?;
    let summary = launched.summary()?;
    eprintln!("computing it again");
    let mut replay = Command::new(program("vigil")?);
    replay
        .arg("replay")
        .arg(&recording)
        .args(["--verify", "--json"]);
    let mut replayed = document(&replay.output()?)?;
    // The path is that of a folder which is gone.
    replayed["recording"] = json!("five-faults.mcap");
    let told = told(&summary, &graph.setup().tree);
    let speed = replayed["speed"].as_f64().unwrap_or_default();
    Ok(json!({
        "is_met": replayed["identical"] == true && speed >= FACTOR_MIN && told == FAULTS_TOLD,
        "faults_told": told,
        "recording_bytes": recording.metadata()?.len(),
        "replay": replayed,
    }))
}

/// Records the graph, once it is there.
fn record(graph: &GraphFile, recording: &Path) -> Result<(), Box<dyn Error>> {
    let mut record = Command::new(program("vigil")?);
    record.args(["record", "--graph", &graph.setup().file.graph.name]);
    record.args(["--duration", &RECORDED_S.to_string()]);
    let output = record.arg(recording).output()?;
    match output.status.success() {
        true => Ok(()),
        false => Err(String::from_utf8_lossy(&output.stderr).into_owned().into()),
    }
}

/// What a program has printed, whatever it ended with.
fn document(output: &Output) -> Result<Value, String> {
    serde_json::from_slice(&output.stdout).map_err(|error| {
        let said = String::from_utf8_lossy(&output.stderr);
        format!("{}, {error}: {said}", output.status)
    })
}

/// How many faults of the robot that have a name became active.
fn told(summary: &Value, tree: &FaultTree) -> usize {
    let is_named = |fault: &Value| tree.nodes().iter().any(|node| fault["name"] == *node.name);
    let events = summary["events"].as_array().into_iter().flatten();
    let active = events.filter(|it| it["fault"]["state"] == "active" && is_named(&it["fault"]));
    let mut numbers: Vec<u64> = active
        .filter_map(|it| it["fault"]["number"].as_u64())
        .collect();
    numbers.sort_unstable();
    numbers.dedup();
    numbers.len()
}

fn archive(document: &Value, outlet: Outlet) -> Result<(), Box<dyn Error>> {
    let mut archive = Archive::new("replay", outlet)?;
    let replay = &document["replay"];
    archive.say(&format!(
        "The rover's graph at {RATE_HZ} Hz for {} s, with five faults injected; {} were told. The \
         recording has {:.0} MB and was computed again at {:.0} times its pace, {}. Bar: identical \
         bits at {FACTOR_MIN} times: {}.\n",
        replay["recorded_s"].as_f64().unwrap_or_default().round(),
        document["faults_told"],
        document["recording_bytes"].as_f64().unwrap_or_default() * 1e-6,
        replay["speed"].as_f64().unwrap_or_default(),
        match replay["identical"] == true {
            true => "identical to the last bit",
            false => "not identical",
        },
        match document["is_met"] == true {
            true => "met",
            false => "missed",
        },
    ));
    archive.say("| service | answers | compared | different | states | gaps |");
    archive.say("|---|---|---|---|---|---|");
    for service in replay["services"].as_array().into_iter().flatten() {
        let name = service["service"].as_str().unwrap_or_default();
        let counts = ["answers", "compared", "different", "states", "gaps"];
        let counts = counts.map(|count| service[count].to_string()).join(" | ");
        archive.say(&format!("| {name} | {counts} |"));
    }
    archive.store("replay.json", document)?;
    archive.close()?;
    Ok(())
}
