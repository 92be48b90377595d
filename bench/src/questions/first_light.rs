//! Does the graph do its main job? Stuck wheel, quiet drive, recorded runs, held-out evaluation.
//!
//! Runs the real commands, stores what they print, and says the figures that matter.

use std::collections::BTreeMap;
use std::error::Error;
use std::path::{Path, PathBuf};
use std::process::Command;

use serde_json::{Value, json};
use vigil_bench::archive::Archive;
use vigil_bench::percentile;

const FRAMES: &str = "tests/data/rover/learn_frames.csv.gz";
const LABELS: &str = "tests/data/rover/learn_runs.csv";
const MODEL: &str = "config/models/rover.toml";

/// Answers the question.
pub fn run() -> Result<(), Box<dyn Error>> {
    let mut archive = Archive::new("first-light")?;
    for rate in ["100", "1000"] {
        let options = [
            "--rate",
            rate,
            "--duration",
            "15",
            "--inject",
            "stuck:RM@5",
            "--json",
        ];
        let summary = up(&mut archive, &format!("stuck-{rate}hz.json"), &options)?;
        say_stuck(&mut archive, &summary);
        let options = ["--rate", rate, "--duration", "60", "--json"];
        let summary = up(&mut archive, &format!("quiet-{rate}hz.json"), &options)?;
        let alarms = events(&summary, "alarm").count();
        archive.say(&format!("- alarms in 60 s without a fault: {alarms}"));
        say_latency(&mut archive, &summary);
    }
    let options = [
        "--replay", FRAMES, "--runs", "heldout", "--speed", "20", "--json",
    ];
    let summary = up(&mut archive, "replay-heldout.json", &options)?;
    say_replay(&mut archive, &summary)?;
    for sensors in ["pose+encoders", "pose"] {
        evaluate(&mut archive, sensors)?;
    }
    archive.close()?;
    Ok(())
}

/// Runs `scripts/up`, stores and returns its document.
fn up(archive: &mut Archive, name: &str, options: &[&str]) -> Result<Value, Box<dyn Error>> {
    archive.say(&format!("\n`scripts/up {}` ({name})\n", options.join(" ")));
    let document = document(Command::new(root().join("scripts/up")).args(options))?;
    archive.store(name, &document)?;
    Ok(document)
}

fn document(command: &mut Command) -> Result<Value, Box<dyn Error>> {
    let output = command.current_dir(root()).output()?;
    if !output.status.success() {
        let text = String::from_utf8_lossy(&output.stderr).into_owned();
        return Err(format!("{command:?}: {}\n{text}", output.status).into());
    }
    Ok(serde_json::from_slice(&output.stdout)?)
}

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..")
}

fn events<'a>(summary: &'a Value, kind: &'a str) -> impl Iterator<Item = (f64, &'a str)> {
    let all = summary["events"]
        .as_array()
        .map(Vec::as_slice)
        .unwrap_or_default();
    // Two services tell alarms: what a user reads is the supervisor's.
    let is_told = |e: &&Value| e["event"] != "alarm" || e["service"] == "supervisor";
    let all = all.iter().filter(is_told);
    all.filter(move |e| e["event"] == kind).map(|e| {
        (
            e["t_s"].as_f64().unwrap_or(f64::NAN),
            e["what"].as_str().unwrap_or_default(),
        )
    })
}

fn say_stuck(archive: &mut Archive, summary: &Value) {
    let injected = events(summary, "injected").next().map_or(f64::NAN, |e| e.0);
    let after = |kind: &str, wanted: &dyn Fn(&str) -> bool| {
        let found = events(summary, kind).find(|(t, what)| *t >= injected && wanted(what));
        found.map_or(f64::NAN, |e| e.0 - injected)
    };
    let alarm = after("alarm", &|_| true);
    let named = after("diagnosis", &|what| what == "RM_STUCK");
    let last = events(summary, "diagnosis")
        .last()
        .map_or("none", |e| e.1)
        .to_owned();
    let acted = after("action", &|what| !what.starts_with("go_on"));
    let any = after("diagnosis", &|_| true);
    archive.say(&format!(
        "- after the injection: alarm {alarm:.3} s, RM_STUCK named {named:.3} s, first action \
         other than go_on {acted:.3} s (first diagnosis {any:.3} s); last diagnosis: {last}"
    ));
    say_latency(archive, summary);
}

fn say_latency(archive: &mut Archive, summary: &Value) {
    let e = &summary["end_to_end_us"];
    let n = e["n"].as_u64().unwrap_or(0);
    let tail = |q: f64, key: &str| percentile(q, n, e[key].to_string());
    archive.say(&format!(
        "- end to end, us: p50 {}, p90 {}, p99 {}, p99.9 {}, max {} (n = {n})",
        e["p50"],
        tail(0.9, "p90"),
        tail(0.99, "p99"),
        tail(0.999, "p999"),
        e["max"],
    ));
    let empty = serde_json::Map::new();
    for (name, service) in summary["services"].as_object().unwrap_or(&empty) {
        archive.say(&format!(
            "- {name}: core {}, {}, {} cycles, {} missed, {} slips, {} lost",
            service["core"],
            service["scheduling"],
            service["cycles"],
            service["missed"],
            service["slips"],
            service["lost"]
        ));
    }
}

/// Modes of the labelled runs.
fn labels() -> Result<BTreeMap<String, String>, Box<dyn Error>> {
    let text = std::fs::read_to_string(root().join(LABELS))?;
    let mut lines = text.lines().map(|line| line.split(',').collect::<Vec<_>>());
    let columns = lines.next().unwrap_or_default();
    let at = |name: &str| {
        columns
            .iter()
            .position(|c| *c == name)
            .ok_or("column missing")
    };
    let (run, mode) = (at("run")?, at("mode")?);
    Ok(lines
        .map(|row| (row[run].to_owned(), row[mode].to_owned()))
        .collect())
}

/// Last diagnosis and alarm of each replayed run, held against the labels.
fn say_replay(archive: &mut Archive, summary: &Value) -> Result<(), Box<dyn Error>> {
    let labels = labels()?;
    let mut runs: BTreeMap<String, (bool, String)> = BTreeMap::new();
    let mut run = String::new();
    let all = summary["events"].as_array().ok_or("no events")?;
    for event in all {
        let what = event["what"].as_str().unwrap_or_default().to_owned();
        match event["event"].as_str() {
            Some("run") => {
                runs.entry(what.clone()).or_default();
                run = what;
            }
            Some("alarm") => runs.entry(run.clone()).or_default().0 = true,
            Some("diagnosis") => runs.entry(run.clone()).or_default().1 = what,
            _ => {}
        }
    }
    let mut counts: BTreeMap<&str, (u32, u32, u32)> = BTreeMap::new();
    for (run, (alarm, named)) in &runs {
        let mode = labels
            .get(run)
            .ok_or_else(|| format!("run {run} has no label"))?;
        let kind = mode.split_once('_').map_or("nominal", |(_, kind)| kind);
        let count = counts.entry(kind).or_default();
        count.0 += 1;
        count.1 += u32::from(*alarm);
        count.2 += u32::from(named == mode || (mode == "ND" && named.is_empty()));
    }
    for (kind, (n, alarms, right)) in counts {
        archive.say(&format!(
            "- {kind}: {n} runs, alarm in {alarms}, rightly named {right}"
        ));
    }
    archive.store("replay-runs.json", &json!(runs))?;
    Ok(())
}

fn evaluate(archive: &mut Archive, sensors: &str) -> Result<(), Box<dyn Error>> {
    let options = [
        "evaluate", "--model", MODEL, "--frames", FRAMES, "--runs", LABELS, "--json",
    ];
    let line = options.join(" ");
    archive.say(&format!(
        "\n`target/release/vigil {line} --sensors {sensors}`\n"
    ));
    let vigil = root().join("target/release/vigil");
    let score = document(
        Command::new(vigil)
            .args(options)
            .args(["--sensors", sensors]),
    )?;
    archive.store(&format!("evaluate-{sensors}.json"), &score)?;
    let alarms = &score["false_alarms"];
    archive.say(&format!("- false alarms: {alarms}"));
    for class in ["stuck", "encoder"] {
        let detection = &score["detection"][class];
        archive.say(&format!("- {class}, detection: {detection}"));
        for at in ["after_2_s", "after_5_s", "after_10_s"] {
            let leaf = &score["identification"][class]["leaf"][at];
            archive.say(&format!("- {class}, leaf {at}: {leaf}"));
        }
    }
    Ok(())
}
