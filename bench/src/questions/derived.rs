//! Does the diagnosis hold on noisier sensors, and does it tell a dead encoder from a stuck wheel?
//!
//! On the runs that the shipped model was not learned from, with default settings and the noise
//! not told: as recorded, with the sensors' noise doubled, and with encoders that die to noise in
//! nominal runs, beside the stuck wheels, which read the same.

use std::error::Error;
use std::fs::{self, File};
use std::io::{BufWriter, Write};
use std::path::{Path, PathBuf};
use std::process::Command;

use serde_json::{Value, json};
use vigil_bench::archive::Archive;
use vigil_evaluation::derived::{Labelled, dead_encoder, noisier, write_frames, write_labels};
use vigil_recording::{frames, labels};
use vigil_robot::Description;
use vigil_robot::learned::Model;

use super::Json;

const MODEL: &str = "config/models/rover.toml";
/// How much noisier the sensors are made.
const FACTOR: f64 = 2.0;
/// When encoders die, s: half way between two frames.
const ONSET_S: f64 = 3.975;
/// What is left of them, rad/s: the noise of a healthy one.
const DEAD_SD_RAD_S: f64 = 0.05;
const SEED: u64 = 1;
/// Ids of runs with a dead encoder: above all recorded ones.
const FIRST_ID: u32 = 10_000;

/// Answers the question.
pub fn run(args: &Json) -> Result<(), Box<dyn Error>> {
    let robot = vigil_setup::load_robot(&root().join("config/robots/rover.toml"))?;
    let model = vigil_setup::load_model(&root().join(MODEL), Some(&robot))?;
    let model = model
        .with_faults()
        .ok_or("the rover's model has no faults")?;
    let folder = std::env::temp_dir().join(format!("vigil-derived-{}", std::process::id()));
    fs::create_dir_all(&folder)?;
    let scored = score_all(&folder, &robot, &model);
    fs::remove_dir_all(&folder)?;
    let sets = scored?;
    let document = json!({
        "factor": FACTOR, "dead_sd_rad_s": DEAD_SD_RAD_S, "onset_s": ONSET_S, "seed": SEED,
        "sets": sets,
    });
    if args.json {
        println!("{document:#}");
        return Ok(());
    }
    let mut archive = Archive::new("derived")?;
    archive.store("derived.json", &document)?;
    for (name, of) in &sets {
        for (sensors, score) in of {
            archive.say(&format!("\n## {name}, {sensors}\n"));
            lines(score).iter().for_each(|line| archive.say(line));
        }
    }
    archive.close()?;
    Ok(())
}

/// Scores by set and sensors.
type Scores = Vec<(String, Vec<(String, Value)>)>;

fn score_all(folder: &Path, robot: &Description, model: &Model) -> Result<Scores, Box<dyn Error>> {
    let recorded = held_out(robot, model)?;
    let mut noisy = Vec::new();
    for (run, label) in &recorded {
        let run = noisier((run, label), &model.noise, robot, FACTOR, SEED)?;
        noisy.push((run, label.clone()));
    }
    let mut dead: Vec<Labelled> = recorded
        .iter()
        .filter(|(_, label)| label.kind == "stuck")
        .cloned()
        .collect();
    for (run, label) in recorded.iter().filter(|(_, label)| label.is_nominal()) {
        for (i, wheel) in robot.wheels.iter().enumerate() {
            let id = FIRST_ID + run.id * robot.wheels.len() as u32 + i as u32;
            let (wheel, noise) = ((i, wheel.name.as_str()), (DEAD_SD_RAD_S, SEED));
            dead.push(dead_encoder((run, label), id, wheel, ONSET_S, noise)?);
        }
    }
    let both = ["pose+encoders", "pose"];
    // By the pose alone a dead encoder leaves no trace.
    let sets = [
        ("as recorded", recorded, &both[..]),
        ("sensor noise doubled", noisy, &both[..]),
        ("dead encoders and stuck wheels", dead, &both[..1]),
    ];
    let mut scores = Vec::new();
    for (name, runs, sensors) in sets {
        write(folder, robot, &runs)?;
        let mut of = Vec::new();
        for &sensors in sensors {
            of.push((sensors.to_owned(), evaluate(folder, sensors)?));
        }
        scores.push((name.to_owned(), of));
    }
    Ok(scores)
}

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..")
}

/// The runs that the model was not learned from.
fn held_out(robot: &Description, model: &Model) -> Result<Vec<Labelled>, Box<dyn Error>> {
    let data = root().join("tests/data/rover");
    let runs = frames::read(&data.join("learn_frames.csv.gz"), robot)?;
    let labels = labels::read(&data.join("learn_runs.csv"), robot)?;
    let held_out = &model.provenance.runs_held_out;
    let wanted = runs.into_iter().filter(|run| held_out.contains(&run.id));
    let mut found = Vec::new();
    for run in wanted {
        let label = labels.iter().find(|label| label.run == run.id);
        let label = label.ok_or_else(|| format!("run {} has no label", run.id))?;
        found.push((run, label.clone()));
    }
    Ok(found)
}

fn write(folder: &Path, robot: &Description, runs: &[Labelled]) -> Result<(), Box<dyn Error>> {
    let mut to = BufWriter::new(File::create(folder.join("frames.csv"))?);
    write_frames(&mut to, robot, runs.iter().map(|(run, _)| run))?;
    to.flush()?;
    let mut to = BufWriter::new(File::create(folder.join("runs.csv"))?);
    write_labels(&mut to, robot, runs.iter().map(|(_, label)| label))?;
    Ok(to.flush()?)
}

/// The score, as the operator's tool gives it.
fn evaluate(folder: &Path, sensors: &str) -> Result<Value, Box<dyn Error>> {
    let mut command = Command::new(root().join("target/release/vigil"));
    command.current_dir(root());
    command.args(["evaluate", "--model", MODEL, "--part", "all", "--json"]);
    command.arg("--frames").arg(folder.join("frames.csv"));
    command.arg("--runs").arg(folder.join("runs.csv"));
    let output = command.args(["--sensors", sensors]).output()?;
    if !output.status.success() {
        let text = String::from_utf8_lossy(&output.stderr).into_owned();
        return Err(format!("{command:?}: {}\n{text}", output.status).into());
    }
    Ok(serde_json::from_slice(&output.stdout)?)
}

/// What matters of a score.
fn lines(score: &Value) -> Vec<String> {
    let percent = |ratio: &Value| match ratio["fraction"].as_f64() {
        Some(fraction) => format!("{:.1} %", 100.0 * fraction),
        None => "-".into(),
    };
    let alarms = &score["false_alarms"];
    let hours = alarms["exposure_h"].as_f64().unwrap_or(f64::NAN);
    let mut out = vec![format!(
        "- false alarms: {} in {hours:.2} h",
        alarms["alarms"]
    )];
    for class in ["stuck", "encoder"] {
        let detection = &score["detection"][class];
        if detection.is_null() {
            continue;
        }
        let delay = &detection["delay"];
        out.push(format!(
            "- {class}: {} of {} detected, p50 {} s, p90 {} s",
            detection["detected"],
            detection["n"],
            seconds(&delay["p50_s"]),
            seconds(&delay["p90_s"])
        ));
        let named = &score["identification"][class];
        for (what, key) in [
            ("leaf", "leaf"),
            ("side", "side"),
            ("told apart (type)", "type"),
        ] {
            let at = |h: &str| percent(&named[key][h]);
            let (two, five, ten) = (at("after_2_s"), at("after_5_s"), at("after_10_s"));
            out.push(format!(
                "- {class}, {what} right at 2/5/10 s: {two} / {five} / {ten}"
            ));
        }
        let claims = &score["calibration"][class];
        out.push(format!(
            "- {class}, at 2 s: log score {}, confident wrong {} of {}",
            seconds(&claims["log_score_nats"]),
            claims["confident_wrong"]["right"],
            claims["confident_wrong"]["n"]
        ));
    }
    out
}

fn seconds(value: &Value) -> String {
    value
        .as_f64()
        .map_or_else(|| "-".into(), |v| format!("{v:.3}"))
}
