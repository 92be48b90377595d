//! How many instructions does a step of each service take, and does that keep to the budget?
//!
//! Counts by valgrind's callgrind, which does not depend on the machine's load. Budgets:
//! `bench/budgets.toml`, one table for each profile of the build. Exit: 0 within them, 1 not.

use std::collections::BTreeMap;
use std::error::Error;
use std::process::{Command, Stdio};

use serde::Deserialize;
use serde_json::json;
use vigil_bench::archive::{Archive, Outlet};
use vigil_bench::simulated;
use vigil_blocks::SensorFrame;
use vigil_robot::Injection;
use vigil_sensor_sim::SensorSource;
use vigil_terminal::output;

/// Cycles that are counted.
const CYCLES: u64 = 600;
/// The cycle before which a wheel of the simulated rover sticks.
const STUCK_CYCLE: u64 = 300;
/// Each service and the functions that are its step, as callgrind names them: it counts between
/// their entry and return.
const STEPS: [(&str, &[&str]); 4] = [
    (
        "sensor-sim",
        &["*Simulation::step*", "*Simulation::measure*"],
    ),
    ("detector", &["*detector::Detector::step*"]),
    ("identifier", &["*diagnoser::Diagnoser::step*"]),
    ("supervisor", &["*supervisor::Supervisor::step*"]),
];
/// The word with which the program is the process that is counted.
pub const RUN_WORD: &str = "run-cycles";

/// Counts the instructions of each service's step.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Only compare with the budgets, archive nothing.
    #[arg(long)]
    check: bool,
}

/// Instructions a step that each service may take, by profile and service.
#[derive(Debug, Deserialize)]
struct Budgets(BTreeMap<String, BTreeMap<String, u64>>);

/// Runs the cycles that are counted.
pub fn run_cycles() -> Result<(), Box<dyn Error>> {
    let setup = vigil_bench::load("rover.toml")?;
    let SensorSource::Simulator(mut simulation, _) = vigil_sensor_sim::assemble(&setup, &[])?
    else {
        return Err("the default graph does not simulate".into());
    };
    let graph = &setup.file.graph;
    let mut stages = simulated::stages(
        &setup,
        setup.file.detector.sensors,
        graph.rate_hz,
        graph.seed,
    )?;
    let stuck = Injection::parse_change("stuck:RM", &setup.robot)?;
    let mut frame = SensorFrame::default();
    frame.header.epoch = 1;
    for cycle in 1..=CYCLES {
        if cycle == STUCK_CYCLE {
            simulation.change(stuck)?;
        }
        simulation.step(1.0 / graph.rate_hz, Some(stages.action()), 0);
        simulation.measure(&mut frame);
        frame.header.seq = cycle;
        frame.header.t_capture_ns = cycle * setup.period_ns();
        stages.take(&frame);
    }
    Ok(())
}

/// Answers the question.
pub fn run(args: &Args) -> Result<(), Box<dyn Error>> {
    let profile = if cfg!(debug_assertions) {
        "dev"
    } else {
        "release"
    };
    let path = vigil_bench::root().join("bench/budgets.toml");
    let budgets: Budgets = toml::from_str(&std::fs::read_to_string(path)?)?;
    let budgets = budgets
        .0
        .get(profile)
        .ok_or("no budgets for this profile")?;
    let mut lines = Vec::new();
    let mut counts = BTreeMap::new();
    let mut over = Vec::new();
    for (service, functions) in STEPS {
        let step = count(functions)? / CYCLES;
        let budget = *budgets.get(service).ok_or("a service has no budget")?;
        let share = 100.0 * step as f64 / budget as f64;
        lines.push(format!("| {service} | {step} | {budget} | {share:.0} % |"));
        counts.insert(service, step);
        if step > budget {
            over.push(service);
        }
    }
    let head = "| service | instructions a step | budget | used |\n|---|---|---|---|";
    if args.check {
        output::line(&format!("{head}\n{}", lines.join("\n")))?;
    } else {
        let mut archive = Archive::new("instructions", Outlet::Files)?;
        archive.say(&format!(
            "`scripts/bench instructions`: the mean of {CYCLES} steps at 100 Hz, a wheel sticks \
             half way; by callgrind. Profile: {profile}.\n\n{head}"
        ));
        lines.iter().for_each(|line| archive.say(line));
        archive.store("instructions.json", &json!({ profile: counts }))?;
        archive.close()?;
    }
    if over.is_empty() {
        return Ok(());
    }
    Err(format!("over budget: {}; see bench/budgets.toml", over.join(", ")).into())
}

/// Instructions within these functions and what they call, over all cycles.
fn count(functions: &[&str]) -> Result<u64, Box<dyn Error>> {
    let output = Command::new("valgrind")
        .args(["--tool=callgrind", "--callgrind-out-file=/dev/null"])
        .args(functions.iter().map(|f| format!("--toggle-collect={f}")))
        .arg(std::env::current_exe()?)
        .arg(RUN_WORD)
        .stdin(Stdio::null())
        .output()
        .map_err(|error| format!("valgrind: {error}; install valgrind"))?;
    let text = String::from_utf8_lossy(&output.stderr);
    if !output.status.success() {
        return Err(format!("valgrind ended with {}\n{text}", output.status).into());
    }
    let line = text.lines().find(|line| line.contains("Collected :"));
    let number = line.and_then(|line| line.rsplit(':').next());
    let number = number.ok_or("valgrind did not say how many instructions it collected")?;
    let count: u64 = number.trim().parse()?;
    if count == 0 {
        return Err(format!("{functions:?} were never entered").into());
    }
    Ok(count)
}
