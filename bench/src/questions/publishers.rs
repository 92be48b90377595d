//! Does a publisher in Python lose frames, and how late are they?

use std::error::Error;
use std::path::Path;
use std::process::{Command, Stdio};

use serde_json::{Value, json};
use vigil_bench::archive::Archive;
use vigil_bench::latency::graph::{Change, Prepared, root};
use vigil_bench::latency::load::{Load, Running};
use vigil_bench::percentile;
use vigil_cycle::serve::Leave;
use vigil_cycle::topic::ServiceName;
use vigil_cycle::{CycleStamps, Schedule};
use vigil_setup::schema::Source;

/// A run is longer than the publisher's by this, s: the publisher waits for all readers to be
/// there, and the graph ends after it.
const AROUND_S: f64 = 4.0;
/// Frames that follow those that are measured, so that none of these is lost unseen.
const AFTER_FRAMES: u32 = 20;

/// Runs the graph with a publisher in Python.
#[derive(Debug, clap::Args)]
pub struct Args {
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

/// Answers the question.
pub fn run(args: &Args) -> Result<(), Box<dyn Error>> {
    if !root().join(&args.python).exists() {
        return Err(format!("there is no {}: scripts/test makes one", args.python).into());
    }
    let rows: Vec<Value> = vigil_bench::in_folder("publishers", |folder| {
        let rates = args.rate.iter();
        rates.map(|rate_hz| one(args, *rate_hz, folder)).collect()
    })?;
    let mut archive = Archive::new("publishers")?;
    tell(args, &rows, &mut archive);
    archive.store("publishers.json", &Value::from(rows))?;
    archive.close()?;
    Ok(())
}

fn tell(args: &Args, rows: &[Value], archive: &mut Archive) {
    let rates: Vec<String> = args.rate.iter().map(f64::to_string).collect();
    archive.say(&format!(
        "`scripts/bench publishers --rate {} --seconds {} --load {}`\n\nA publisher in Python \
         (`bench/pace.py`, SCHED_OTHER) through shared memory. Sent: stamped just before a frame \
         goes out. Answered: cycles of the detector; frames that come together are answered once. \
         Missed: frames that it had not answered by its deadline. Lost: by its account of sequence \
         numbers; {AFTER_FRAMES} more frames follow those that are counted, so that the last of \
         these is not lost unseen. Times in us, from when a frame was due.\n",
        rates.join(","),
        args.seconds,
        args.load.name()
    ));
    archive.say(
        "| rate, Hz | sent | answered | missed | lost | refused | sent p50 | p99 | max | \
         action p50 | p99 | max |\n|---|---|---|---|---|---|---|---|---|---|---|---|",
    );
    for row in rows {
        let n = |key: &str| row[key].to_string();
        let us = |of: &str, q: &str| format!("{:.0}", row[of][q].as_f64().unwrap_or(f64::NAN));
        let tail = |of: &str, n: &Value| percentile(0.99, n.as_u64().unwrap_or(0), us(of, "p99"));
        archive.say(&format!(
            "| {} | {} | {} | {} | {} | {} | {} | {} | {} | {} | {} | {} |",
            n("rate_hz"),
            n("sent"),
            n("answered"),
            n("missed"),
            n("lost"),
            n("refused"),
            us("sent_us", "p50"),
            tail("sent_us", &row["sent"]),
            us("sent_us", "max"),
            us("end_to_end_us", "p50"),
            tail("end_to_end_us", &row["end_to_end_us"]["n"]),
            us("end_to_end_us", "max"),
        ));
    }
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
    let seconds = args.seconds + AROUND_S + f64::from(AFTER_FRAMES) / rate_hz;
    let mut told = Value::Null;
    let ran = prepared.run(seconds, folder, || {
        let output = Command::new(root().join(&args.python))
            .arg(root().join("bench/pace.py"))
            .arg(&prepared.setup().file.graph.name)
            .args([rate_hz.to_string(), args.seconds.to_string()])
            .arg(AFTER_FRAMES.to_string())
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
    // The detector's own count goes on when nobody publishes any more.
    let name = ServiceName::Detector;
    let cycles = &ran.stamps[name.index()];
    let due_ns = |i: usize| told["due_ns"][i].as_u64().ok_or("no times were told");
    let schedule = prepared.setup().plan(name, Leave::default()).schedule;
    let (answered, missed) = answers(cycles, [due_ns(0)?, due_ns(1)?], schedule);
    let detector = &ran.summary["services"]["detector"];
    Ok(json!({
        "rate_hz": rate_hz,
        "sent": told["sent"],
        "sent_us": told["late_us"],
        "answered": answered,
        "lost": detector["lost"],
        "refused": detector["rejected"],
        "missed": missed,
        "end_to_end_us": ran.summary["end_to_end_us"],
    }))
}

/// Of the frames that were due from the first to the last of these instants: the cycles that
/// answered them, and how many were not answered by the deadline.
fn answers(cycles: &[CycleStamps], due_ns: [u64; 2], schedule: Schedule) -> (usize, usize) {
    let [first_ns, last_ns] = due_ns;
    let (mut missed, mut rest) = (0, cycles);
    for instant_ns in (first_ns..=last_ns).step_by(schedule.period_ns as usize) {
        // The newest of those that come together answers them all.
        let older = rest.iter().take_while(|c| c.t_schedule_ns < instant_ns);
        rest = &rest[older.count()..];
        let deadline_ns = instant_ns + schedule.deadline_ns;
        let is_missed = rest.first().is_none_or(|c| c.t_publish_ns > deadline_ns);
        missed += usize::from(is_missed);
    }
    let measured = cycles
        .iter()
        .filter(|c| (first_ns..=last_ns).contains(&c.t_schedule_ns));
    (measured.count(), missed)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_frame_is_answered_by_the_next_cycle_and_missed_after_its_deadline() {
        let schedule = Schedule {
            period_ns: 100,
            deadline_ns: 50,
            budget_ns: 50,
        };
        let cycle = |t_schedule_ns, t_publish_ns| CycleStamps {
            t_schedule_ns,
            t_publish_ns,
            ..CycleStamps::default()
        };
        // In time; late; two at once, of which the newer is in time; after the last.
        let cycles = [
            cycle(1000, 1050),
            cycle(1100, 1151),
            cycle(1300, 1310),
            cycle(1400, 1410),
        ];
        assert_eq!(answers(&cycles, [1000, 1300], schedule), (3, 2));
        // Nothing came after them.
        assert_eq!(answers(&cycles[..1], [1000, 1300], schedule), (1, 3));
        assert_eq!(answers(&[], [1000, 1300], schedule), (0, 4));
    }
}
