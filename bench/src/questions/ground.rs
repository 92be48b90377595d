//! Does a model that was learned on one soil fail honestly on stiffer ones?

use std::error::Error;
use std::path::Path;
use std::time::Instant;

use serde_json::{Value, json};
use vigil_bench::archive::Archive;
use vigil_bench::ground::{self, Figures, Run, STIFFER, figures};
use vigil_bench::machine;
use vigil_bench::matched::in_parallel;
use vigil_bench::shares::Share;
use vigil_bench::simulated::{Rover, SENSOR_SETS};
use vigil_evaluation::scoring::Taxonomy;

/// Types of faults: first word of the specification.
const TYPES: [&str; 2] = ["stuck", "encoder"];

/// Worlds of every cell.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Worlds per cell.
    #[arg(long, value_name = "N", default_value_t = 2)]
    seeds: u64,
    /// Seed of the first; tuning takes 100000 or more, and so no run that is archived.
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
    let taxonomy = Taxonomy::new(&rover.tree, &rover.robot);
    let jobs = ground::jobs(&rover, args.seeds, args.first_seed);
    let began = Instant::now();
    let drive = |job: &_| ground::drive(&rover, &taxonomy, job).map_err(|e| e.to_string());
    let runs: Result<Vec<Vec<Run>>, String> = in_parallel(&jobs, drive).into_iter().collect();
    let runs: Vec<Run> = runs?.into_iter().flatten().collect();
    let wall_s = began.elapsed().as_secs_f64();
    let document = json!({
        "machine": machine::facts(), "wall_s": wall_s, "soils": soils_json(&runs),
    });
    if args.json {
        println!("{document:#}");
        return Ok(());
    }
    let mut archive = Archive::new("ground")?;
    archive.store("ground.json", &document)?;
    let lines: Vec<String> = runs.iter().map(Run::line).collect();
    archive.store_text(
        "runs.csv",
        &format!("{}\n{}\n", Run::HEAD, lines.join("\n")),
    )?;
    report(&mut archive, &runs);
    archive.say(&format!("\nWall time {wall_s:.0} s."));
    archive.close()?;
    Ok(())
}

fn select<'a>(runs: &'a [Run], stiffer: f64, sensors: &str, fault: &str) -> Vec<&'a Run> {
    let of = |run: &Run| match &run.job.fault {
        None => fault.is_empty(),
        Some((spec, _)) => !fault.is_empty() && spec.starts_with(fault),
    };
    let here = |run: &&Run| run.job.stiffer == stiffer && run.sensors == sensors && of(run);
    runs.iter().filter(here).collect()
}

/// A broken encoder leaves no trace in a pose.
fn is_visible(sensors: &str, fault: &str) -> bool {
    fault == "stuck" || sensors != SENSOR_SETS[0].1
}

fn nominal_alarms(runs: &[Run], stiffer: f64, sensors: &str) -> Share {
    Share::of(select(runs, stiffer, sensors, ""), |run| run.false_alarm)
}

fn soils_json(runs: &[Run]) -> Vec<Value> {
    let mut soils = Vec::new();
    for stiffer in STIFFER {
        for (_, sensors) in SENSOR_SETS {
            let mut soil = json!({
                "stiffer": stiffer, "sensors": sensors,
                "nominal_runs_with_alarm": nominal_alarms(runs, stiffer, sensors).json(),
            });
            for fault in TYPES.into_iter().filter(|fault| is_visible(sensors, fault)) {
                soil[fault] = figures(&select(runs, stiffer, sensors, fault)).json();
            }
            soils.push(soil);
        }
    }
    soils
}

fn report(archive: &mut Archive, runs: &[Run]) {
    archive.say(
        "The model as it ships, learned on soil of shear modulus 0.2 (±10 % from run to run); \
         soils that many times stiffer, friction 0.6 to 0.7, scatter 0.08; 20 Hz.",
    );
    for (_, sensors) in SENSOR_SETS {
        for fault in TYPES.into_iter().filter(|fault| is_visible(sensors, fault)) {
            archive.say(&format!("\n## {sensors}, {fault}\n"));
            Figures::HEAD.into_iter().for_each(|line| archive.say(line));
            for stiffer in STIFFER {
                let found = figures(&select(runs, stiffer, sensors, fault));
                archive.say(&found.row(&format!("{stiffer} x")));
            }
        }
        let alarms: Vec<String> = STIFFER
            .iter()
            .map(|&stiffer| {
                let share = nominal_alarms(runs, stiffer, sensors);
                format!("{} of {} ({stiffer} x)", share.hits, share.of)
            })
            .collect();
        archive.say(&format!(
            "\nNominal runs with an alarm: {}.",
            alarms.join(", ")
        ));
    }
}
