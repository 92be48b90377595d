//! Is what no model contains detected, and called unknown? And what does nominal driving raise?

use std::error::Error;
use std::path::Path;
use std::time::Instant;

use serde_json::{Value, json};
use vigil_bench::archive::Archive;
use vigil_bench::machine;
use vigil_bench::matched::in_parallel;
use vigil_bench::shares::poisson_upper;
use vigil_bench::simulated::{Rover, SENSOR_SETS};
use vigil_bench::unmodelled::{
    self, Band, Cell, NONCENTRALITY_MIN, Nominal, Run, Totals, bands, by_kind, drive_nominal,
    excluded, totals,
};

use super::from_zero;

/// Rates at which frames come: all cells at the first, every fourth at the second. Four shares no
/// factor with the turns and speeds of a size, so that all of them come up.
const RATES_HZ: [f64; 2] = [20.0, 100.0];
const EVERY: usize = 4;

/// How much is driven.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Worlds per cell.
    #[arg(long, value_name = "N", default_value_t = 2)]
    seeds: u64,
    /// Nominal driving, h.
    #[arg(long, value_name = "H", default_value_t = 24.0, value_parser = from_zero)]
    hours: f64,
    /// Seed of the first; tuning takes 10000000 or more, and so no run that is archived.
    #[arg(long, value_name = "S", default_value_t = 1)]
    first_seed: u64,
    /// Print one JSON document, archive nothing.
    #[arg(long)]
    json: bool,
}

/// Answers the question.
pub fn run(args: &Args) -> Result<(), Box<dyn Error>> {
    if cfg!(debug_assertions) {
        return Err("a debug build takes hours: use scripts/bench".into());
    }
    let rover = Rover::read(&Path::new(env!("CARGO_MANIFEST_DIR")).join(".."))?;
    let began = Instant::now();
    let runs = disturbed(&rover, args.seeds, args.first_seed)?;
    let disturbed_s = began.elapsed().as_secs_f64();
    eprintln!("{} runs in {disturbed_s:.0} s", runs.len());
    let began = Instant::now();
    let nominal = nominal(&rover, args.hours, args.first_seed)?;
    let nominal_s = began.elapsed().as_secs_f64();
    let mut document = json!({
        "machine": machine::facts(), "noncentrality_min": NONCENTRALITY_MIN,
        "wall_s": { "disturbed": disturbed_s, "nominal": nominal_s },
        "excluded": excluded(&runs),
    });
    for (key, rate_hz) in [("rate_20_hz", 20.0), ("rate_100_hz", 100.0)] {
        document[key] = SENSOR_SETS
            .iter()
            .map(|(_, sensors)| (sensors.to_string(), figures(&runs, sensors, rate_hz)))
            .collect::<serde_json::Map<_, _>>()
            .into();
    }
    document["nominal"] = nominal_json(&nominal);
    if args.json {
        println!("{document:#}");
        return Ok(());
    }
    let mut archive = Archive::new("unmodelled")?;
    archive.store("unmodelled.json", &document)?;
    let lines: Vec<String> = runs.iter().map(Run::line).collect();
    archive.store_text(
        "runs.csv",
        &format!("{}\n{}\n", Run::HEAD, lines.join("\n")),
    )?;
    report(&mut archive, &runs);
    report_nominal(&mut archive, &nominal);
    archive.say(&format!(
        "\nWall time: disturbances {disturbed_s:.0} s, nominal driving {nominal_s:.0} s."
    ));
    archive.close()?;
    Ok(())
}

/// All cells with all seeds.
fn disturbed(rover: &Rover, seeds: u64, first: u64) -> Result<Vec<Run>, Box<dyn Error>> {
    let cells = unmodelled::cells();
    let mut jobs: Vec<(&Cell, f64, u64)> = Vec::new();
    for (i, cell) in cells.iter().enumerate() {
        let seed = |k: u64| first + k + seeds * i as u64;
        jobs.extend((0..seeds).map(|k| (cell, RATES_HZ[0], seed(k))));
        if i % EVERY == 0 {
            jobs.push((cell, RATES_HZ[1], seed(0)));
        }
    }
    let run = |&(cell, rate_hz, seed): &(&Cell, f64, u64)| {
        unmodelled::run_cell(rover, cell, rate_hz, seed)
            .map_err(|error| format!("{}: {error}", cell.spec))
    };
    let done: Result<Vec<Vec<Run>>, String> = in_parallel(&jobs, run).into_iter().collect();
    Ok(done?.into_iter().flatten().collect())
}

fn nominal(rover: &Rover, hours: f64, first: u64) -> Result<Vec<Nominal>, Box<dyn Error>> {
    let count = (hours * 3600.0 / unmodelled::RUN_S).ceil() as u64;
    let seeds: Vec<u64> = (0..count).map(|k| 1_000_000 + first + k - 1).collect();
    let drive = |seed: &u64| drive_nominal(rover, *seed).map_err(|error| error.to_string());
    let runs: Result<Vec<Nominal>, String> = in_parallel(&seeds, drive).into_iter().collect();
    Ok(runs?)
}

fn select<'a>(runs: &'a [Run], sensors: &str, rate_hz: f64) -> Vec<&'a Run> {
    let is = |run: &&Run| run.sensors == sensors && run.rate_hz == rate_hz;
    runs.iter().filter(is).collect()
}

fn figures(runs: &[Run], sensors: &str, rate_hz: f64) -> Value {
    let runs = select(runs, sensors, rate_hz);
    let kinds = by_kind(&runs);
    let kinds: serde_json::Map<String, Value> = kinds
        .into_iter()
        .map(|(kind, totals)| (kind.to_owned(), totals.json()))
        .collect();
    let bands = bands(&runs).into_iter().map(|band| {
        json!({
            "noncentrality": [band.from, band.to], "detected": band.detected.json(),
            "p_clairvoyant": band.p_clairvoyant,
        })
    });
    let bands: Vec<Value> = bands.collect();
    json!({ "all": totals(&runs).json(), "kinds": kinds, "bands": bands })
}

fn report(archive: &mut Archive, runs: &[Run]) {
    archive.say(&format!(
        "Left out: runs whose noncentrality over 2 s is below {NONCENTRALITY_MIN} (the fault all \
         but does not show), listed in `unmodelled.json`, or with an alarm before the onset."
    ));
    for (_, sensors) in SENSOR_SETS {
        for rate_hz in RATES_HZ {
            let runs = select(runs, sensors, rate_hz);
            archive.say(&format!("\n## {sensors}, {rate_hz} Hz\n"));
            Totals::HEAD.into_iter().for_each(|line| archive.say(line));
            for (kind, totals) in by_kind(&runs) {
                archive.say(&totals.row(kind));
            }
            let all = totals(&runs);
            archive.say(&all.row("all"));
            archive.say(&format!("\nAll: {}.", all.words()));
            let bands: Vec<String> = bands(&runs).iter().map(words).collect();
            archive.say(&format!(
                "Detected within 2 s, by noncentrality (in brackets, of how many; then what a test \
                 could at most that is told the fault and its onset): {}.",
                bands.join(", ")
            ));
        }
    }
}

fn words(band: &Band) -> String {
    let range = match band.to {
        to if to < 1e9 => format!("{} to {to}", band.from),
        _ => format!("from {}", band.from),
    };
    let bound_percent = 100.0 * band.p_clairvoyant;
    format!("{range}: {}; {bound_percent:.1} %", band.detected.short())
}

fn alarms(nominal: &[Nominal], set: usize) -> usize {
    nominal.iter().map(|run| run.alarms[set].len()).sum()
}

fn nominal_json(nominal: &[Nominal]) -> Value {
    let hours = nominal.len() as f64 * unmodelled::RUN_S / 3600.0;
    let set = |(i, (_, sensors)): (usize, &(_, &str))| {
        let count = alarms(nominal, i);
        let raised = nominal.iter().filter(|run| !run.alarms[i].is_empty());
        let raised = raised.map(|run| {
            let alarms = run.alarms[i].iter().map(|alarm| {
                json!({
                    "t_s": alarm.t_s, "curvature_1_m": alarm.curvature_1_m,
                    "speed_m_s": alarm.speed_m_s,
                })
            });
            let alarms: Vec<Value> = alarms.collect();
            json!({
                "seed": run.seed, "noise_scale": run.noise_scale, "scatter": run.scatter,
                "alarms": alarms, "commands_change_s": run.changes_s,
            })
        });
        let figures = json!({
            "hours": hours, "alarms": count, "per_hour_upper_95": poisson_upper(count) / hours,
            "runs": raised.collect::<Vec<Value>>(),
        });
        (sensors.to_string(), figures)
    };
    let sets = SENSOR_SETS.iter().enumerate().map(set);
    sets.collect::<serde_json::Map<_, _>>().into()
}

fn report_nominal(archive: &mut Archive, nominal: &[Nominal]) {
    let hours = nominal.len() as f64 * unmodelled::RUN_S / 3600.0;
    archive.say("\n## Nominal driving\n");
    archive.say(
        "Random commands from the whole range learned, noise scale 0.5 to 2 and scatter of the \
         friction up to 0.12 drawn for each run.\n",
    );
    for (i, (_, sensors)) in SENSOR_SETS.iter().enumerate() {
        let count = alarms(nominal, i);
        let upper = poisson_upper(count) / hours;
        let soon: usize = nominal.iter().map(|run| run.soon_after_a_command(i)).sum();
        archive.say(&format!(
            "- {sensors}: {count} alarms in {hours:.1} h (95 %: at most {upper:.3} per hour), \
             {soon} of them within 1.5 s of a new command (a share of {:.0} % of the time)",
            100.0 * unmodelled::share_soon(nominal)
        ));
    }
}
