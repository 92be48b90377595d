//! `vigil init`: the files of a new robot, to be corrected by hand.

use std::fs;
use std::path::{Path, PathBuf};

use schemars::JsonSchema;
use serde::Serialize;
use vigil_import as import;
use vigil_setup::{NAME_LENGTH_MAX, load_robot};
use vigil_terminal::{CommandError, Outcome, output};

use crate::commands::files::write_whole;

/// What to do about a fault of any robot: parameters, the model that follows, its policy.
const RECOVERY: &str = include_str!("../../../../config/any-robot.recovery.toml");
const DECISION: &str = include_str!("../../../../config/any-robot.pomdp");
const POLICY: &str = include_str!("../../../../config/any-robot.policy.json");
/// The fault tree that follows from the robot's description.
const TREE: &str = include_str!("../../../../config/trees/generated.toml");
/// Rate of a graph whose log is not known, Hz.
const RATE_HZ: f64 = 20.0;

/// Writes the files of a new robot into a folder: graph, robot, fault tree, decision model, policy.
///
/// From a log it also writes how that is read, and describes the robot as far as the log shows it.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Folder to make; its name becomes the robot's and the graph's.
    #[arg(value_name = "FOLDER")]
    folder: PathBuf,
    /// A log of the robot: recording of ROS 2, CSV file, or a folder of these.
    #[arg(long, value_name = "LOG", required_unless_present = "robot")]
    from: Option<PathBuf>,
    /// Description of the robot, to be copied.
    #[arg(long, value_name = "FILE", conflicts_with = "from")]
    robot: Option<PathBuf>,
    /// Print one JSON document.
    #[arg(long)]
    json: bool,
}

/// What it prints with --json.
#[derive(Debug, Serialize, JsonSchema)]
pub struct Document {
    /// Version of this document.
    schema_version: u32,
    /// Paths of the files written.
    files: Vec<String>,
    /// What was guessed or left out, a sentence each: to be checked by hand.
    unsure: Vec<String>,
    /// Commands that lead from here to a live diagnosis, in order.
    next: Vec<String>,
}

/// What is written.
struct NewRobot {
    robot: String,
    /// Description of the log, and where that lies.
    log: Option<(String, PathBuf)>,
    rate_hz: f64,
    unsure: Vec<String>,
}

/// Writes the files, and says what is unsure and what comes next.
///
/// # Errors
/// A folder that holds files of these names; a log that cannot be read or understood.
pub fn run(args: &Args) -> Result<Outcome, CommandError> {
    let name = graph_name(&args.folder)?;
    let new = match (&args.from, &args.robot) {
        (Some(from), _) => from_log(from, &name)?,
        (None, Some(robot)) => from_robot(robot)?,
        (None, None) => return Err(CommandError::usage("--from or --robot is required")),
    };
    let mut files = vec![
        ("graph.toml", graph(&name, new.rate_hz)),
        ("robot.toml", new.robot),
        ("tree.toml", TREE.to_owned()),
        ("recovery.toml", recovery(&args.folder)),
        ("decision.pomdp", DECISION.to_owned()),
        ("decision.policy.json", POLICY.to_owned()),
    ];
    let from = new.log.map(|(text, from)| {
        files.push(("log.toml", text));
        from
    });
    let folder = &args.folder;
    for (file, _) in &files {
        let file = folder.join(file);
        if file.exists() {
            let message = format!("{} exists: nothing was written", file.display());
            return Err(CommandError::usage(message));
        }
    }
    fs::create_dir_all(folder)
        .map_err(|error| CommandError::failure(format!("{}: {error}", folder.display())))?;
    for (file, text) in &files {
        write_whole(&folder.join(file), text)?;
    }
    let place = |file: &str| folder.join(file).display().to_string();
    let document = Document {
        schema_version: 1,
        files: files.iter().map(|(file, _)| place(file)).collect(),
        unsure: new.unsure,
        next: next(folder, from.as_deref()),
    };
    let printed = match args.json {
        true => output::json(&document),
        false => output::line(&text(&document)),
    };
    printed.map_err(CommandError::failure)?;
    Ok(Outcome::Done)
}

/// The folder's name as a graph may have it.
fn graph_name(folder: &Path) -> Result<String, CommandError> {
    let name = folder.file_name().unwrap_or_default().to_string_lossy();
    let legal = |c: char| if c.is_ascii_alphanumeric() { c } else { '-' };
    let name: String = name.chars().map(legal).take(NAME_LENGTH_MAX).collect();
    match name.chars().any(|c| c != '-') {
        true => Ok(name),
        false => Err(CommandError::usage(
            "the folder's name becomes the graph's: it needs a letter or digit",
        )),
    }
}

fn from_log(log: &Path, name: &str) -> Result<NewRobot, CommandError> {
    let suggestion = import::suggest(log, name, "robot.toml").map_err(CommandError::usage)?;
    Ok(NewRobot {
        robot: suggestion.robot,
        log: Some((suggestion.log, suggestion.folder)),
        rate_hz: suggestion.rate_hz,
        unsure: suggestion.unsure,
    })
}

fn from_robot(path: &Path) -> Result<NewRobot, CommandError> {
    load_robot(path).map_err(CommandError::usage)?;
    let robot = fs::read_to_string(path)
        .map_err(|error| CommandError::usage(format!("{}: {error}", path.display())))?;
    let rate = format!("graph.toml: rate_hz = {RATE_HZ:?} is assumed");
    Ok(NewRobot {
        robot,
        log: None,
        rate_hz: RATE_HZ,
        unsure: vec![rate],
    })
}

/// The parameters, with the commands for this folder's files.
fn recovery(folder: &Path) -> String {
    let of = |file: &str| folder.join(file).display().to_string();
    RECOVERY
        .replace("config/any-robot.recovery.toml", &of("recovery.toml"))
        .replace("config/any-robot.policy.json", &of("decision.policy.json"))
        .replace("config/any-robot.pomdp", &of("decision.pomdp"))
        .replace("any-robot.pomdp", "decision.pomdp")
}

/// Two neighbours share a core; on four or more each has its own.
fn graph(name: &str, rate_hz: f64) -> String {
    let cores = std::thread::available_parallelism().map_or(1, std::num::NonZero::get);
    let [a, b, c, d] = match cores {
        0 | 1 => [0; 4],
        2 | 3 => [0, 0, 1, 1],
        _ => [0, 1, 2, 3],
    };
    format!(
        r#"# The graph of a new robot. Every key, its unit and range: docs/configuration.md.
# Paths are relative to this file.
[graph]
name = "{name}"
rate_hz = {rate_hz:?}
seed = 1

[files]
robot = "robot.toml"
tree = "tree.toml"
model = "model.toml"
decision = "decision.pomdp"

[services]
sensor-sim = {{ core = {a}, priority = 55, deadline_percent = 20.0 }}
detector = {{ core = {b}, priority = 52, deadline_percent = 50.0 }}
identifier = {{ core = {c}, priority = 51, deadline_percent = 75.0 }}
supervisor = {{ core = {d}, priority = 53, deadline_percent = 95.0 }}

# "external": a publisher in shared memory; "socket": datagrams.
[sensor]
source = "external"

# A healthy robot is to alarm once in so many hours.
[detector]
false_alarm_interval_h = 24.0
fault_rate_1_h = 1.0

# Model and policy are made from recovery.toml, which says how.
[supervisor]
policy = "point-based"
policy_file = "decision.policy.json"
switching_cost = 1.0
epoch_ms = 100.0
validity_periods = 10.0

# What the actions of decision.pomdp are.
[supervisor.actions]
go_on = {{ kind = "go_on" }}
slow_down = {{ kind = "slow_down", speed_scale = 0.5 }}
stop = {{ kind = "stop" }}
call_for_help = {{ kind = "call_for_help" }}
"#
    )
}

/// The commands from here to a live diagnosis.
fn next(folder: &Path, log: Option<&Path>) -> Vec<String> {
    let at = |file: &str| folder.join(file).display().to_string();
    let frames = match log {
        Some(log) => format!(
            "vigil import --log {} --from {} --out {}",
            at("log.toml"),
            log.display(),
            at("frames.csv.gz")
        ),
        None => format!(
            "vigil record --config {} --out {}",
            at("graph.toml"),
            at("frames.csv.gz")
        ),
    };
    vec![
        frames,
        format!(
            "vigil learn --robot {} --frames {} --test-fraction 0 --out {}",
            at("robot.toml"),
            at("frames.csv.gz"),
            at("model.toml")
        ),
        format!("vigil check --config {}", at("graph.toml")),
        format!("scripts/up --config {}", at("graph.toml")),
    ]
}

fn text(document: &Document) -> String {
    let mut lines: Vec<String> = document.files.clone();
    lines.extend(document.unsure.iter().map(|line| format!("unsure: {line}")));
    lines.push("correct robot.toml, then:".to_owned());
    lines.extend(document.next.iter().map(|line| format!("  {line}")));
    lines.join("\n")
}
