//! The questions, and what the options of several of them share.

pub mod bits;
pub mod blackbox;
pub mod corridors;
pub mod field;
pub mod first_minute;
pub mod ground_change;
pub mod healthy;
pub mod instructions;
pub mod latency;
pub mod missions;
pub mod mutants;
pub mod peers;
pub mod promise;
pub mod real_logs;
pub mod replay;
pub mod size;
pub mod solver;
pub mod step;
pub mod taped_wheels;
pub mod top;

use std::error::Error;
use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::Path;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::Instant;

use serde_json::{Value, json};
use vigil_bench::archive::{Archive, Outlet};
use vigil_bench::variation::{Comparison, say_comparisons, without_lead};
use vigil_evaluation::parallel::at_once;
use vigil_missions::learning::{Record, file};
use vigil_pomdp::Pomdp;

/// Missions between two lines of progress.
const PROGRESS: usize = 100;
/// First seed of a sweep: no measurement takes one of these.
const SWEEP_SEED: u64 = 1_000_000;

/// Options of the questions that drive missions.
#[derive(Debug, clap::Args)]
pub struct MissionArgs {
    /// Seed of the first.
    #[arg(long, value_name = "S", default_value_t = 1)]
    first_seed: u64,
    /// Tune the rules instead, on missions of their own, from where they stand.
    #[arg(long)]
    sweep: bool,
    /// Compare Vigil and rules in each variation of `bench/variations.toml` instead.
    #[arg(long, conflicts_with = "sweep")]
    vary: bool,
    /// Print the result as one JSON document, archive nothing.
    #[arg(long)]
    json: bool,
}

impl MissionArgs {
    /// Seed of the first mission; a sweep has its own.
    const fn first_seed(&self) -> u64 {
        match self.sweep {
            true => SWEEP_SEED,
            false => self.first_seed,
        }
    }

    /// Archives the document with the lines of its missions, if there are any, and what `say` says
    /// of it; or prints it.
    fn keep(
        &self,
        question: &str,
        mut document: Value,
        began: Instant,
        lines: Option<String>,
        say: impl FnOnce(&mut Archive),
    ) -> Result<(), Box<dyn Error>> {
        document["wall_s"] = json!(began.elapsed().as_secs_f64());
        let mut archive = Archive::new(question, Outlet::by_flag(self.json))?;
        archive.store(&format!("{question}.json"), &document)?;
        if let Some(lines) = lines {
            archive.store_text(&format!("{question}.csv"), &lines)?;
        }
        say(&mut archive);
        archive.close()?;
        Ok(())
    }

    /// Keeps what was compared under variations, and demands that Vigil leads in each.
    fn keep_comparisons(
        &self,
        question: &str,
        found: &[Comparison],
        began: Instant,
        head: &str,
        harm: &str,
    ) -> Result<(), Box<dyn Error>> {
        let short = without_lead(found);
        let of_each: Vec<Value> = found.iter().map(Comparison::document).collect();
        let document = json!({"variations": of_each, "short": short});
        self.keep(question, document, began, None, |archive| {
            archive.say(head);
            say_comparisons(archive, found, harm);
            archive.say("");
            short
                .iter()
                .for_each(|line| archive.say(&format!("- Short: {line}.")));
        })?;
        demand_none(&short)
    }
}

/// Every mission on all cores, with progress on standard error.
fn drive_all<P: Sync, M: Send>(
    plans: &[P],
    drive: impl Fn(&P) -> Result<M, Box<dyn Error>> + Sync,
) -> Result<Vec<M>, Box<dyn Error>> {
    let cores = std::thread::available_parallelism()?.get();
    drive_at_once(cores, plans, drive)
}

/// Every mission, so many at once, with progress on standard error.
fn drive_at_once<P: Sync, M: Send>(
    workers: usize,
    plans: &[P],
    drive: impl Fn(&P) -> Result<M, Box<dyn Error>> + Sync,
) -> Result<Vec<M>, Box<dyn Error>> {
    let (began, done) = (Instant::now(), AtomicUsize::new(0));
    let drive = |plan: &P| {
        let mission = drive(plan).map_err(|e| e.to_string());
        let so_far = done.fetch_add(1, Ordering::Relaxed) + 1;
        if so_far % PROGRESS == 0 {
            let (count, passed_s) = (plans.len(), began.elapsed().as_secs_f64());
            eprintln!("{so_far} of {count} missions in {passed_s:.0} s");
        }
        mission
    };
    let missions: Result<Vec<M>, String> = at_once(workers, plans, drive).into_iter().collect();
    Ok(missions?)
}

/// Writes the steps of a decision model in missions, as `vigil pomdp fit` reads them.
fn write_records(
    path: &Path,
    policy: String,
    model: &Pomdp,
    records: &[Record],
) -> Result<(), Box<dyn Error>> {
    let mut out = BufWriter::new(File::create(path)?);
    file::write_head(&mut out, policy)?;
    for record in records {
        file::write(&mut out, model, record)?;
    }
    Ok(out.flush()?)
}

/// A number from 0 to 1.
fn share(text: &str) -> Result<f64, String> {
    let number = text.parse().ok();
    let number = number.filter(|share| (0.0..=1.0).contains(share));
    number.ok_or_else(|| "allowed is a number from 0 to 1".to_owned())
}

/// Refuses to have missed bars.
fn demand_none(missed: &[String]) -> Result<(), Box<dyn Error>> {
    match missed.len() {
        0 => Ok(()),
        count => Err(format!("{count} bars are missed").into()),
    }
}
