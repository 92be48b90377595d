//! Do the tests notice when a line of the filters, the decision or the cycle is wrong?
//!
//! Draws mutants by seed with `cargo mutants` in a clone of the project, runs each package's tests
//! on each of its mutants, and reports the share that is caught. A mutant that does not compile is
//! replaced by another one. A mutant that nobody catches needs its reason in
//! `bench/survivors.toml`. Exit: 1 if fewer than 85 % are caught.

use std::collections::BTreeMap;
use std::error::Error;
use std::io::{self, Write as _};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use rand::SeedableRng;
use rand::seq::SliceRandom;
use rand_pcg::Pcg64Mcg;
use serde::Deserialize;
use serde_json::json;
use vigil_bench::archive::{Archive, Outlet};

/// Packages whose lines decide what Vigil says.
const PACKAGES: [&str; 4] = [
    "vigil-cycle",
    "vigil-diagnosis",
    "vigil-inference",
    "vigil-decision",
];
/// Share of the mutants that the tests must catch.
const CAUGHT_MIN: f64 = 0.85;
/// Time that the tests of one mutant may take, s: a multiple of the slowest package's. A mutant
/// that takes longer hangs, which is noticed too.
const TIMEOUT_S: &str = "400";
/// With what `timeout` ends if it had to.
const TIMED_OUT: i32 = 124;

/// Which mutants are drawn.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Mutants that compile
    #[arg(long, value_name = "N", default_value_t = 120)]
    count: usize,
    /// Seed of the draw
    #[arg(long, value_name = "SEED", default_value_t = 1)]
    seed: u64,
    /// Draw from these packages only (repeatable)
    #[arg(long, value_name = "PACKAGE", default_values = PACKAGES)]
    package: Vec<String>,
}

/// A change of one place in the code, as `cargo mutants --list --json` describes it.
#[derive(Debug, Clone, Deserialize)]
struct Mutant {
    name: String,
    package: String,
    file: PathBuf,
    diff: String,
}

/// What the tests made of one mutant.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Verdict {
    Caught,
    Missed,
    /// The tests did not end, which is noticed too.
    TimedOut,
    /// It does not compile.
    Unviable,
}

/// A mutant with what became of it.
#[derive(Debug)]
struct Trial {
    name: String,
    package: String,
    verdict: Verdict,
}

/// How many mutants of a package ended how.
#[derive(Debug, Default)]
struct Counts {
    caught: usize,
    missed: usize,
    unviable: usize,
}

impl Counts {
    fn add(&mut self, verdict: Verdict) {
        match verdict {
            Verdict::Caught | Verdict::TimedOut => self.caught += 1,
            Verdict::Missed => self.missed += 1,
            Verdict::Unviable => self.unviable += 1,
        }
    }
}

/// Reasons of mutants that need not be caught, by their names without line and column.
#[derive(Debug, Default, Deserialize)]
struct Survivors {
    #[serde(default)]
    survivor: Vec<Survivor>,
}

#[derive(Debug, Deserialize)]
struct Survivor {
    mutant: String,
    reason: String,
}

/// Answers the question.
pub fn run(args: &Args) -> Result<(), Box<dyn Error>> {
    vigil_bench::in_clone("mutants", |clone| measure(args, clone))
}

fn measure(args: &Args, clone: &Path) -> Result<(), Box<dyn Error>> {
    // Read first: a file that is wrong must not cost the run.
    let survivors = std::fs::read_to_string(vigil_bench::root().join("bench/survivors.toml"))?;
    let survivors: Survivors = toml::from_str(&survivors)?;
    // A warning about code that a mutant no longer uses must not hide the mutant.
    let manifest = clone.join("Cargo.toml");
    let text = std::fs::read_to_string(&manifest)?;
    std::fs::write(&manifest, text.replace("\"deny\"", "\"warn\""))?;
    let mut mutants = listed(clone, &args.package)?;
    let drawable = mutants.len();
    mutants.shuffle(&mut Pcg64Mcg::seed_from_u64(args.seed));
    for package in &args.package {
        if tried(clone, package)? != Verdict::Missed {
            return Err(format!("the tests of {package} fail without any mutant").into());
        }
    }
    let mut archive = Archive::new("mutants", Outlet::Files)?;
    let mut trials: Vec<Trial> = Vec::new();
    let mut viable = 0;
    for mutant in mutants {
        if viable == args.count {
            break;
        }
        let verdict = judged(clone, &mutant)?;
        viable += usize::from(verdict != Verdict::Unviable);
        eprintln!("{viable} of {}: {verdict:?}: {}", args.count, mutant.name);
        trials.push(Trial {
            name: mutant.name,
            package: mutant.package,
            verdict,
        });
    }
    let share = tell(&mut archive, args, drawable, &trials, &survivors)?;
    archive.close()?;
    if share < CAUGHT_MIN {
        let percent = share * 100.0;
        return Err(format!("{percent:.1} % are caught, not {CAUGHT_MIN}").into());
    }
    Ok(())
}

/// All mutants, in the order of the files.
fn listed(clone: &Path, packages: &[String]) -> Result<Vec<Mutant>, Box<dyn Error>> {
    let mut command = Command::new("cargo");
    command
        .args(["mutants", "--list", "--json"])
        .current_dir(clone);
    for package in packages {
        command.args(["--package", package]);
    }
    let output = command.output()?;
    if !output.status.success() {
        let text = String::from_utf8_lossy(&output.stderr);
        return Err(format!("cargo mutants --list: {text}").into());
    }
    Ok(serde_json::from_slice(&output.stdout)?)
}

/// Applies the mutant, lets its package's tests judge it, and takes it back.
fn judged(clone: &Path, mutant: &Mutant) -> Result<Verdict, Box<dyn Error>> {
    let file = clone.join(&mutant.file);
    let original = std::fs::read_to_string(&file)?;
    let mut patch = Command::new("patch")
        .arg("--quiet")
        .arg(&file)
        .stdin(Stdio::piped())
        .spawn()?;
    patch
        .stdin
        .take()
        .ok_or("no standard input")?
        .write_all(mutant.diff.as_bytes())?;
    if !patch.wait()?.success() {
        return Err(format!("{} cannot be applied", mutant.name).into());
    }
    let verdict = tried(clone, &mutant.package)?;
    std::fs::write(&file, original)?;
    Ok(verdict)
}

/// What a package's tests make of the clone as it is.
fn tried(clone: &Path, package: &str) -> io::Result<Verdict> {
    let test = ["test", "--quiet", "--locked", "--package", package];
    let status = |command: &mut Command| {
        let command = command.current_dir(clone).stdout(Stdio::null());
        command.stderr(Stdio::null()).status()
    };
    // Only the tests have a limit: what is built first takes its time.
    if !status(Command::new("cargo").args(test).arg("--no-run"))?.success() {
        return Ok(Verdict::Unviable);
    }
    let limited = [TIMEOUT_S, "cargo"];
    let tests = status(Command::new("timeout").args(limited).args(test))?;
    Ok(match tests.code() {
        Some(0) => Verdict::Missed,
        Some(TIMED_OUT) => Verdict::TimedOut,
        _ => Verdict::Caught,
    })
}

/// `file: what` of a mutant's `file:line:column: what`.
fn without_place(name: &str) -> String {
    let mut parts = name.splitn(4, ':');
    let (file, what) = (parts.next(), parts.nth(2));
    format!("{}:{}", file.unwrap_or_default(), what.unwrap_or_default())
}

/// Writes the table; returns the share that was caught.
fn tell(
    archive: &mut Archive,
    args: &Args,
    drawable: usize,
    trials: &[Trial],
    survivors: &Survivors,
) -> Result<f64, Box<dyn Error>> {
    let mut by_package: BTreeMap<&str, Counts> = BTreeMap::new();
    let mut all = Counts::default();
    for trial in trials {
        by_package
            .entry(&trial.package)
            .or_default()
            .add(trial.verdict);
        all.add(trial.verdict);
    }
    archive.say(&format!(
        "{} of {drawable} mutants, seed {}.\n",
        trials.len(),
        args.seed
    ));
    archive.say("| package | caught | missed | did not compile |\n|---|---|---|---|");
    let rows = by_package
        .iter()
        .map(|(package, counts)| (*package, counts));
    for (package, counts) in rows.chain([("all", &all)]) {
        let Counts {
            caught,
            missed,
            unviable,
        } = counts;
        archive.say(&format!("| {package} | {caught} | {missed} | {unviable} |"));
    }
    let share = all.caught as f64 / (all.caught + all.missed).max(1) as f64;
    archive.say(&format!(
        "\n{:.1} % of those that compile are caught.\n",
        share * 100.0
    ));
    let missed = trials
        .iter()
        .filter(|trial| trial.verdict == Verdict::Missed);
    for trial in missed {
        let known = without_place(&trial.name);
        let reason = survivors
            .survivor
            .iter()
            .find(|survivor| survivor.mutant == known);
        let reason = reason.map_or("no reason is known", |survivor| survivor.reason.as_str());
        archive.say(&format!("- `{}`: {reason}", trial.name));
    }
    let names = |verdict| -> Vec<&str> {
        let those = trials.iter().filter(|trial| trial.verdict == verdict);
        those.map(|trial| trial.name.as_str()).collect()
    };
    archive.store(
        "mutants.json",
        &json!({
            "seed": args.seed,
            "drawable": drawable,
            "caught_share": share,
            "missed": names(Verdict::Missed),
            "timed_out": names(Verdict::TimedOut),
        }),
    )?;
    Ok(share)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_place_is_taken_off_a_name() {
        assert_eq!(
            without_place("a/b.rs:1:2: replace + with -"),
            "a/b.rs: replace + with -"
        );
        assert_eq!(without_place("a/b.rs:1:2: x::f -> y"), "a/b.rs: x::f -> y");
    }
}
