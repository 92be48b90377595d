//! Does a publisher in Python lose frames, and how late are they?

use std::error::Error;
use std::path::Path;
use std::process::{Command, ExitCode, Stdio};

use clap::Parser;
use serde_json::{Value, json};
use vigil_bench::archive::Archive;
use vigil_bench::latency::graph::{Change, Prepared, root};
use vigil_bench::latency::load::{Load, Running};
use vigil_setup::schema::Source;

/// A run is longer than the publisher's by this, s: the publisher waits for all readers to be
/// there, and the graph ends after it.
const AROUND_S: f64 = 4.0;

/// Runs the graph with a publisher in Python.
#[derive(Debug, Parser)]
#[command(name = "scripts/bench publishers")]
struct Args {
    /// Rates, Hz; separated by commas.
    #[arg(long, value_name = "HZ", value_delimiter = ',', default_values_t = [100.0, 1000.0])]
    rate: Vec<f64>,
    /// Time of each run, s.
    #[arg(long, value_name = "S", default_value_t = 60.0)]
    seconds: f64,
    /// Load beside the graph.
    #[arg(long, default_value = "cpu")]
    load: Load,
    /// Python with the packages of tests/python/requirements.txt.
    #[arg(long, value_name = "PATH", default_value = "target/python/bin/python")]
    python: String,
}

fn main() -> ExitCode {
    vigil_bench::ended("publishers", run(&Args::parse()))
}

fn run(args: &Args) -> Result<(), Box<dyn Error>> {
    if !root().join(&args.python).exists() {
        return Err(format!("there is no {}: scripts/test makes one", args.python).into());
    }
    let folder = std::env::temp_dir().join(format!("vigil-publishers-{}", std::process::id()));
    std::fs::create_dir_all(&folder)?;
    let rows: Result<Vec<Value>, Box<dyn Error>> = args
        .rate
        .iter()
        .map(|rate_hz| one(args, *rate_hz, &folder))
        .collect();
    let _ = std::fs::remove_dir_all(&folder);
    let (rows, load) = (rows?, args.load.name());
    let mut archive = Archive::new("publishers")?;
    archive.say(&format!(
        "`scripts/bench publishers --rate {} --seconds {} --load {load}`\n\nA publisher in Python \
         (`bench/pace.py`, SCHED_OTHER) through shared memory. Lost: by the detector's account of \
         sequence numbers; frames that come together are answered once. Times in us, from when a \
         frame was due.\n",
        args.rate
            .iter()
            .map(f64::to_string)
            .collect::<Vec<_>>()
            .join(","),
        args.seconds
    ));
    archive.say(
        "| rate, Hz | sent | answered | lost | refused | sent p50 | p99 | max | action p50 | p99 | \
         max |\n|---|---|---|---|---|---|---|---|---|---|---|",
    );
    for row in &rows {
        let n = |key: &str| row[key].to_string();
        let us = |of: &str, q: &str| format!("{:.0}", row[of][q].as_f64().unwrap_or(f64::NAN));
        archive.say(&format!(
            "| {} | {} | {} | {} | {} | {} | {} | {} | {} | {} | {} |",
            n("rate_hz"),
            n("sent"),
            n("answered"),
            n("lost"),
            n("refused"),
            us("sent_us", "p50"),
            us("sent_us", "p99"),
            us("sent_us", "max"),
            us("end_to_end_us", "p50"),
            us("end_to_end_us", "p99"),
            us("end_to_end_us", "max"),
        ));
    }
    archive.store("publishers.json", &Value::from(rows))?;
    println!("archived in {}", archive.close()?.display());
    Ok(())
}

fn one(args: &Args, rate_hz: f64, folder: &Path) -> Result<Value, Box<dyn Error>> {
    eprintln!("{rate_hz} Hz");
    let change = Change {
        rate_hz,
        particles: 1000,
        is_fifo: true,
        source: Source::External,
        is_faulty: false,
    };
    let prepared = Prepared::new(change, folder)?;
    let load = Running::start(args.load, &prepared.cores(), folder, None)?;
    let mut told = Value::Null;
    let summary = prepared.run_beside(args.seconds + AROUND_S, || {
        let output = Command::new(root().join(&args.python))
            .arg(root().join("bench/pace.py"))
            .arg(&prepared.setup().file.graph.name)
            .args([rate_hz.to_string(), args.seconds.to_string()])
            .stdin(Stdio::null())
            .stderr(Stdio::inherit())
            .output()?;
        if !output.status.success() {
            return Err(format!("the publisher ended with {}", output.status).into());
        }
        told = serde_json::from_slice(&output.stdout)?;
        Ok(())
    })?;
    load.finish()?;
    let detector = &summary["services"]["detector"];
    Ok(json!({
        "rate_hz": rate_hz,
        "sent": told["sent"],
        "sent_us": told["late_us"],
        "answered": detector["cycles"],
        "lost": detector["lost"],
        "refused": detector["rejected"],
        "missed": detector["missed"],
        "end_to_end_us": summary["end_to_end_us"],
    }))
}
