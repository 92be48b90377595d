//! Does the latency report tell the machine's misses from Vigil's own?
//!
//! Stalls of known origin are made in a running graph: a stage is stopped by a signal, or a core is
//! kept by a process above everything else; see `vigil_bench::latency::stalls`.

use std::error::Error;
use std::path::Path;
use std::time::Duration;

use serde_json::{Value, json};
use vigil_bench::archive::Archive;
use vigil_bench::latency::graph::{Change, Prepared};
use vigil_bench::latency::load::{Load, Running};
use vigil_bench::latency::stalls::{self, Origin, Stall, Told};
use vigil_setup::schema::Source;

/// Most hypotheses of the identifier.
const PARTICLES: usize = 1000;

/// Makes stalls of known origin and reads what the latency report says of them.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Rate of the schedule, Hz.
    #[arg(long, value_name = "HZ", default_value_t = 1000.0)]
    rate: f64,
    /// Stalls of each origin and length.
    #[arg(long, value_name = "N", default_value_t = 40)]
    stalls: usize,
    /// Lengths of the stalls, us; separated by commas.
    #[arg(long, value_name = "US", value_delimiter = ',',
          default_values_t = [500, 1000, 2000, 5000, 20_000, 80_000])]
    length_us: Vec<u64>,
    /// Load beside the graph.
    #[arg(long, default_value = "cpu")]
    load: Load,
    /// Print one JSON document, archive nothing.
    #[arg(long)]
    json: bool,
}

/// Answers the question.
pub fn run(args: &Args) -> Result<(), Box<dyn Error>> {
    let rows = vigil_bench::in_folder("attribution", |folder| measure(args, folder))?;
    if args.json {
        println!("{:#}", Value::from(rows));
        return Ok(());
    }
    archive(args, &rows)
}

/// One document for each origin and length.
fn measure(args: &Args, folder: &Path) -> Result<Vec<Value>, Box<dyn Error>> {
    let change = Change {
        rate_hz: args.rate,
        particles: PARTICLES,
        is_fifo: true,
        source: Source::Simulator,
        is_faulty: false,
    };
    let prepared = Prepared::new(change, folder)?;
    let lengths: Vec<Duration> = args
        .length_us
        .iter()
        .copied()
        .map(Duration::from_micros)
        .collect();
    let load = Running::start(args.load, &prepared.cores(), folder, Some(prepared.path()))?;
    let (made, misses) = stalls::run(&prepared, (args.stalls, &lengths), folder)?;
    load.finish()?;
    prepared.setup().domain()?.remove_residue();
    let mut rows = Vec::new();
    for (origin, name) in [(Origin::Graph, "vigil"), (Origin::Machine, "machine")] {
        for &length in &lengths {
            let wanted = |stall: &Stall| (stall.origin, stall.length) == (origin, length);
            let told = Told::of(&made, &misses, wanted);
            let counts = |[ours, machine]: [usize; 2]| json!({"ours": ours, "machine": machine});
            rows.push(json!({
                "origin": name,
                "length_us": length.as_micros() as u64,
                "stalls": told.stalls,
                "unseen": told.unseen,
                "missed_within": counts(told.within),
                "missed_after": counts(told.after),
            }));
        }
    }
    Ok(rows)
}

fn archive(args: &Args, rows: &[Value]) -> Result<(), Box<dyn Error>> {
    let mut archive = Archive::new("attribution")?;
    let lengths: Vec<String> = args.length_us.iter().map(u64::to_string).collect();
    archive.say(&format!(
        "`scripts/bench attribution --rate {} --stalls {} --length-us {} --load {}`\n\n\
         A stage that is stopped is Vigil's own, a core that is kept by another process the \
         machine's. Missed cycles by what the report says of them: those due or not yet done in a \
         stall, and those that it left behind.\n",
        args.rate,
        args.stalls,
        lengths.join(","),
        args.load.name(),
    ));
    archive.say(
        "| whose | length, us | stalls | unseen | missed within: own | machine | after: own | \
         machine |\n|---|---|---|---|---|---|---|---|",
    );
    for row in rows {
        let n = |key: &str| row[key].to_string();
        let (within, after) = (&row["missed_within"], &row["missed_after"]);
        archive.say(&format!(
            "| {} | {} | {} | {} | {} | {} | {} | {} |",
            row["origin"].as_str().unwrap_or_default(),
            n("length_us"),
            n("stalls"),
            n("unseen"),
            within["ours"],
            within["machine"],
            after["ours"],
            after["machine"],
        ));
    }
    archive.store("stalls.json", &Value::from(rows.to_vec()))?;
    archive.close()?;
    Ok(())
}
