//! How long from a clone to the first alarm, packages downloaded?
//!
//! Clones the project into a folder of its own, runs the README's first command there, and reads
//! when the first alarm came. Cargo's timings of that build stay with the raw data.

use std::error::Error;
use std::io::{BufRead, BufReader};
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::Instant;

use serde_json::{Value, json};
use vigil_bench::archive::{Archive, Outlet};

/// The README's first command.
const OPTIONS: [&str; 4] = ["--duration", "15", "--inject", "stuck:RM@5"];
/// In the line that cargo ends a build with.
const BUILT: &str = "Finished `release` profile";
/// Cargo's report of a build: a page that holds its data as one line of a script.
const UNITS: &str = "const UNIT_DATA = ";

/// Answers the question.
pub fn run() -> Result<(), Box<dyn Error>> {
    vigil_bench::in_clone("first-minute", measure)
}

fn measure(clone: &Path) -> Result<(), Box<dyn Error>> {
    let mut archive = Archive::new("first-minute", Outlet::Files)?;
    let began = Instant::now();
    let mut up = Command::new(clone.join("scripts/up"))
        .args(OPTIONS)
        .env("VIGIL_BUILD_OPTIONS", "--timings")
        .current_dir(clone)
        .stdout(Stdio::null())
        .stderr(Stdio::piped())
        .spawn()?;
    // Cargo's lines and, as things happen, the timeline's.
    let lines = BufReader::new(up.stderr.take().ok_or("no standard error")?).lines();
    let (mut built_s, mut alarm_s) = (None, None);
    for line in lines {
        let line = line?;
        let so_far_s = began.elapsed().as_secs_f64();
        if line.contains(BUILT) {
            built_s = built_s.or(Some(so_far_s));
        }
        if line.contains(" alarm ") {
            alarm_s = alarm_s.or(Some(so_far_s));
        }
    }
    if !up.wait()?.success() {
        return Err("scripts/up failed".into());
    }
    let report = std::fs::read_to_string(clone.join("target/cargo-timings/cargo-timing.html"))?;
    let units = units(&report)?;
    let unit_s: f64 = units
        .iter()
        .filter_map(|unit| unit["duration"].as_f64())
        .sum();
    let built_s = built_s.ok_or("cargo did not say that the build ended")?;
    let alarm_s = alarm_s.ok_or("no alarm was printed")?;
    archive.say(&format!(
        "| | s |\n|---|---|\n| build | {built_s:.0} |\n\
         | build, time of its {} units added up | {unit_s:.0} |\n\
         | first alarm, a fault injected after 5 s included | {alarm_s:.0} |",
        units.len(),
    ));
    let document = json!({
        "built_s": built_s,
        "unit_s": unit_s,
        "alarm_s": alarm_s,
        "slowest": slowest(units),
    });
    archive.store("first-minute.json", &document)?;
    archive.store_text("cargo-timing.html", &report)?;
    archive.close()?;
    Ok(())
}

/// What cargo's report says of each unit it compiled.
fn units(report: &str) -> Result<Vec<Value>, Box<dyn Error>> {
    let (_, data) = report
        .split_once(UNITS)
        .ok_or("cargo's report has no units")?;
    let mut values = serde_json::Deserializer::from_str(data).into_iter();
    let units: Vec<Value> = values.next().ok_or("cargo's report has no units")??;
    Ok(units)
}

/// The twenty slowest units: package, target, s.
fn slowest(mut units: Vec<Value>) -> Vec<Value> {
    let duration_s = |unit: &Value| unit["duration"].as_f64().unwrap_or(0.0);
    units.sort_by(|a, b| duration_s(b).total_cmp(&duration_s(a)));
    let short = |unit: &Value| json!([unit["name"], unit["target"], duration_s(unit)]);
    units.iter().take(20).map(short).collect()
}
