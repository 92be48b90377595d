//! Where does zero-copy pay?
//!
//! The same chain of four stages over Vigil's ports, a bare futex, Unix datagrams, pipes and a
//! queue within one process, at four sizes of block.

use std::error::Error;
use std::path::Path;

use clap::ValueEnum;
use serde_json::{Value, json};
use vigil_bench::archive::{Archive, Outlet};
use vigil_bench::chain::carriers::Carrier;
use vigil_bench::chain::{Chain, STAGES};
use vigil_bench::latency::cell::us;
use vigil_bench::latency::cycles::{Spectra, join};
use vigil_bench::latency::load::{Load, LoadProcess};
use vigil_bench::percentile;

/// Sizes of block, bytes.
const SIZES: [usize; 4] = [64, 4 << 10, 64 << 10, 1 << 20];
/// Cycles at the start that do not count, ns.
const WARM_UP_NS: u64 = 500_000_000;

/// Compares ways of handing blocks on.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Rate of the schedule, Hz.
    #[arg(long, value_name = "HZ", default_value_t = 1000.0)]
    rate: f64,
    /// Time of each run, s.
    #[arg(long, value_name = "S", default_value_t = 5.0)]
    seconds: f64,
    /// Runs of each carrier and size, one round after the other.
    #[arg(long, value_name = "N", default_value_t = 3)]
    rounds: usize,
    /// Sizes of block, separated by commas; there are these alone.
    #[arg(long, value_delimiter = ',', default_values_t = SIZES)]
    bytes: Vec<usize>,
    /// Load beside them.
    #[arg(long, default_value = "keep-awake")]
    load: Load,
    /// Print the result as one JSON document, archive nothing.
    #[arg(long)]
    json: bool,
}

/// Cores and priorities as in the default graph.
const PLACED: [(usize, u8); STAGES] = [(0, 55), (0, 52), (1, 51), (1, 53)];

/// Answers the question.
pub fn run(args: &Args) -> Result<(), Box<dyn Error>> {
    let mut cores: Vec<usize> = PLACED.map(|(core, _)| core).to_vec();
    cores.dedup();
    let rows = vigil_bench::in_folder("peers", |folder| {
        let _load = LoadProcess::start(args.load, &cores, folder, None)?;
        measure(args, folder)
    })?;
    archive(args, &rows)
}

fn measure(args: &Args, folder: &Path) -> Result<Vec<Value>, Box<dyn Error>> {
    let mut rows = Vec::new();
    for round in 1..=args.rounds {
        for &size in &args.bytes {
            for &carrier in Carrier::value_variants() {
                eprintln!(
                    "round {round} of {}: {carrier:?}, {size} bytes",
                    args.rounds
                );
                let chain = Chain {
                    carrier,
                    sizes: [size; STAGES],
                    placed: PLACED,
                    period_ns: (1e9 / args.rate).round() as u64,
                    cycles: (args.rate * args.seconds) as u64,
                };
                rows.push(one(&chain, round, folder));
            }
        }
    }
    Ok(rows)
}

/// One run; what it cannot do is a row as well.
fn one(chain: &Chain, round: usize, folder: &Path) -> Value {
    let carrier = chain.carrier.to_possible_value();
    let carrier = carrier.map_or_else(String::new, |v| v.get_name().to_owned());
    let (size, period_ns) = (chain.sizes[0], chain.period_ns);
    let found = chain.run(folder).and_then(|stamps| {
        let first_ns = stamps[0].first().map_or(0, |s| s.t_schedule_ns);
        let cycles = join(&stamps, period_ns, first_ns + WARM_UP_NS);
        if cycles.is_empty() {
            return Err("nothing arrived".into());
        }
        Ok((Spectra::new(&cycles)?, cycles))
    });
    match found {
        Ok((spectra, cycles)) => json!({
            "carrier": carrier, "bytes": size, "round": round, "cycles": cycles.len(),
            "folded": cycles.iter().filter(|cycle| cycle.is_folded()).count(),
            "end_to_end_us": us(&spectra.end_to_end),
            "hand_over_us": us(&spectra.hand_over),
            "compute_us": us(&spectra.compute),
        }),
        Err(error) => json!({
            "carrier": carrier, "bytes": size, "round": round, "failed": error.to_string(),
        }),
    }
}

fn archive(args: &Args, rows: &[Value]) -> Result<(), Box<dyn Error>> {
    let mut archive = Archive::new("peers", Outlet::by_flag(args.json))?;
    let (rate, seconds, load) = (args.rate, args.seconds, args.load.name());
    let rounds = args.rounds;
    archive.say(&format!(
        "`scripts/bench peers --rate {rate} --seconds {seconds} --rounds {rounds} --load \
         {load}`\n\nFrom the schedule to the last publication (end to end), and the part of it in \
         which no stage fills or looks at a block: three hops and the source's wake-up \
         (hand-over). In us: the median of {rounds} interleaved runs of p50 and of p99, with the \
         range over the runs. Folded: instants of all runs that had no answer of their own; they \
         have the latency until the next. `shared-memory` is Vigil's transport, `futex` the \
         floor; both leave the block where it is. Cores {:?}.\n",
        PLACED.map(|(core, _)| core)
    ));
    archive.say(
        "| bytes | carrier | hand-over p50 | p99 | end to end p50 | p99 | folded |\n\
         |---|---|---|---|---|---|---|",
    );
    for &size in &args.bytes {
        for carrier in Carrier::value_variants() {
            let name = carrier.to_possible_value();
            let name = name.map_or_else(String::new, |v| v.get_name().to_owned());
            let of = |row: &&Value| row["carrier"] == *name && row["bytes"] == size;
            let runs: Vec<&Value> = rows.iter().filter(of).collect();
            archive.say(&line(size, &name, &runs));
        }
    }
    archive.store("peers.json", &Value::from(rows.to_vec()))?;
    archive.close()?;
    Ok(())
}

fn line(size: usize, name: &str, runs: &[&Value]) -> String {
    if let Some(failed) = runs.iter().find_map(|run| run["failed"].as_str()) {
        return format!("| {size} | {name} | not possible: {failed} | | | | |");
    }
    let of = |part: &str, key: &str| {
        let values = runs.iter().filter_map(|run| run[part][key].as_f64());
        let mut values: Vec<f64> = values.collect();
        let median = vigil_bench::quantile(&mut values, 0.5);
        let ends = [values.first(), values.last()];
        let [least, most] = ends.map(|value| value.copied().unwrap_or(f64::NAN));
        format!("{median:.1} ({least:.1} to {most:.1})")
    };
    let tail = |part: &str| {
        let n = runs.iter().filter_map(|run| run[part]["n"].as_u64());
        percentile(0.99, n.min().unwrap_or(0), of(part, "p99"))
    };
    let sum = |key: &str| -> u64 { runs.iter().filter_map(|run| run[key].as_u64()).sum() };
    format!(
        "| {size} | {name} | {} | {} | {} | {} | {} of {} |",
        of("hand_over_us", "p50"),
        tail("hand_over_us"),
        of("end_to_end_us", "p50"),
        tail("end_to_end_us"),
        sum("folded"),
        sum("cycles"),
    )
}
