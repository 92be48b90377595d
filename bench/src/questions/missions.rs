//! What is Vigil worth? Missions with random faults: with it, without, and with plainer rules.
//!
//! Exit: 1 if Vigil does not win on the mission reward against going on and against the escalation.

use std::error::Error;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::Instant;

use serde_json::json;
use vigil_bench::archive::Archive;
use vigil_bench::machine;
use vigil_bench::missions::{self, Mission, Plan, ShippedGraph};
use vigil_evaluation::parallel::in_parallel;

/// Missions between two lines of progress.
const PROGRESS: usize = 25;

/// Which missions.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Missions.
    #[arg(long, value_name = "N", default_value_t = 1000)]
    missions: u64,
    /// Seed of the first; tuning takes others than what is archived.
    #[arg(long, value_name = "S", default_value_t = 1)]
    first_seed: u64,
    /// Rate of the frames, Hz.
    #[arg(long, value_name = "HZ", default_value_t = 100.0, value_parser = from_zero)]
    rate: f64,
    /// Print one JSON document, archive nothing.
    #[arg(long)]
    json: bool,
}

/// Answers the question.
pub fn run(args: &Args) -> Result<(), Box<dyn Error>> {
    if cfg!(debug_assertions) {
        return Err("a debug build takes hours: use scripts/bench".into());
    }
    let (count, first, rate_hz) = (args.missions, args.first_seed, args.rate);
    let shipped = ShippedGraph::read(rate_hz)?;
    let plans: Vec<Plan> = (first..first + count).map(Plan::new).collect();
    let (began, done) = (Instant::now(), AtomicUsize::new(0));
    let drive = |plan: &Plan| {
        let mission = missions::drive(&shipped, plan.clone()).map_err(|e| e.to_string());
        let so_far = done.fetch_add(1, Ordering::Relaxed) + 1;
        if so_far % PROGRESS == 0 {
            let passed_s = began.elapsed().as_secs_f64();
            eprintln!("{so_far} of {count} missions in {passed_s:.0} s");
        }
        mission
    };
    let driven: Result<Vec<Mission>, String> = in_parallel(&plans, drive).into_iter().collect();
    let driven = driven?;
    let wall_s = began.elapsed().as_secs_f64();
    let mut document = missions::document(&driven);
    document["machine"] = machine::facts();
    document["wall_s"] = json!(wall_s);
    document["rate_hz"] = json!(rate_hz);
    if args.json {
        println!("{document:#}");
        return won(&driven);
    }
    let mut archive = Archive::new("missions")?;
    archive.store("missions.json", &document)?;
    archive.store_text("missions.csv", &missions::lines(&driven))?;
    missions::say(&mut archive, &driven, rate_hz);
    archive.say(&format!("\nWall time {wall_s:.0} s."));
    archive.close()?;
    won(&driven)
}

fn won(driven: &[Mission]) -> Result<(), Box<dyn Error>> {
    match missions::lost_against(driven).as_slice() {
        [] => Ok(()),
        lost => Err(format!("Vigil does not win on the mission reward against: {lost:?}").into()),
    }
}

/// A finite number of at least 0.
fn from_zero(text: &str) -> Result<f64, String> {
    let number = text.parse().ok();
    let number = number.filter(|n: &f64| n.is_finite() && *n >= 0.0);
    number.ok_or_else(|| "allowed is a number from 0".to_owned())
}
