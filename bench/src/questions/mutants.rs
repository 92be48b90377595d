//! Do the tests notice when a line of the filters, the decision or the cycle is wrong?
//!
//! Draws mutants by seed with `cargo mutants` in a clone of the project, runs each package's tests
//! on each of its mutants, and reports the share that is caught. A mutant that does not compile is
//! replaced by another one. A mutant that nobody catches needs its reason in
//! `bench/survivors.toml`. Exit: 1 if fewer than 85 % are caught.

use std::collections::BTreeMap;
use std::error::Error;
use std::path::{Path, PathBuf};
use std::process::Command;

use rand::SeedableRng;
use rand::seq::SliceRandom;
use rand_pcg::Pcg64Mcg;
use serde::Deserialize;
use serde_json::json;
use vigil_bench::archive::Archive;

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
const TIMEOUT_S: &str = "300";

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

/// What the tests made of one mutant.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
enum Verdict {
    Success,
    CaughtMutant,
    MissedMutant,
    Timeout,
    Unviable,
    #[serde(other)]
    Other,
}

/// The part of cargo-mutants' report that is read.
#[derive(Debug, Deserialize)]
struct Report {
    outcomes: Vec<Outcome>,
}

#[derive(Debug, Deserialize)]
struct Outcome {
    scenario: Scenario,
    summary: Verdict,
}

/// What was tried: a mutant, or the unchanged tree.
#[derive(Debug, Deserialize)]
enum Scenario {
    Baseline,
    Mutant { name: String, package: String },
}

/// A mutant with what became of it.
#[derive(Debug)]
struct Trial {
    name: String,
    package: String,
    verdict: Verdict,
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
    vigil_bench::in_folder("mutants", |folder| measure(args, folder))
}

fn measure(args: &Args, folder: &Path) -> Result<(), Box<dyn Error>> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
    let clone = folder.join("vigil");
    let status = Command::new("git")
        .args(["clone", "--quiet", "--no-hardlinks"])
        .args([&root, &clone])
        .status()?;
    if !status.success() {
        return Err("git clone failed".into());
    }
    let mut names = listed(&clone, &args.package)?;
    let drawable = names.len();
    names.shuffle(&mut Pcg64Mcg::seed_from_u64(args.seed));
    let mut archive = Archive::new("mutants")?;
    let mut trials: Vec<Trial> = Vec::new();
    let mut names = names.into_iter();
    loop {
        let viable = trials
            .iter()
            .filter(|trial| trial.verdict != Verdict::Unviable);
        let batch: Vec<String> = names.by_ref().take(args.count - viable.count()).collect();
        if batch.is_empty() {
            break;
        }
        trials.extend(tried(&clone, &args.package, &batch)?);
    }
    let survivors = std::fs::read_to_string(root.join("bench/survivors.toml"))?;
    let survivors: Survivors = toml::from_str(&survivors)?;
    let share = tell(&mut archive, args, drawable, &trials, &survivors)?;
    archive.close()?;
    if share < CAUGHT_MIN {
        return Err(format!("{:.1} % are caught, not {CAUGHT_MIN}", share * 100.0).into());
    }
    Ok(())
}

fn cargo_mutants(clone: &Path, packages: &[String]) -> Command {
    let mut command = Command::new("cargo");
    command.arg("mutants").current_dir(clone);
    for package in packages {
        command.args(["--package", package]);
    }
    command
}

/// Names of all mutants, in the order of the files.
fn listed(clone: &Path, packages: &[String]) -> Result<Vec<String>, Box<dyn Error>> {
    let output = cargo_mutants(clone, packages).arg("--list").output()?;
    if !output.status.success() {
        let text = String::from_utf8_lossy(&output.stderr);
        return Err(format!("cargo mutants --list: {text}").into());
    }
    Ok(String::from_utf8(output.stdout)?
        .lines()
        .map(str::to_owned)
        .collect())
}

/// Runs the tests on each mutant of `names`.
fn tried(
    clone: &Path,
    packages: &[String],
    names: &[String],
) -> Result<Vec<Trial>, Box<dyn Error>> {
    let mut command = cargo_mutants(clone, packages);
    // Denied warnings must not hide a mutant.
    command.args(["--in-place", "--cap-lints", "true", "--timeout", TIMEOUT_S]);
    for name in names {
        command.args(["--re", &format!("^{}$", escaped(name))]);
    }
    // 2: some were missed; 3: some took too long. Both stand in the report.
    let code = command.status()?.code();
    if !matches!(code, Some(0 | 2 | 3)) {
        return Err(format!("cargo mutants ended with {code:?}").into());
    }
    let report: PathBuf = clone.join("mutants.out/outcomes.json");
    let report: Report = serde_json::from_str(&std::fs::read_to_string(report)?)?;
    let trials = report
        .outcomes
        .into_iter()
        .filter_map(|outcome| match outcome.scenario {
            Scenario::Baseline => None,
            Scenario::Mutant { name, package } => Some(Trial {
                name,
                package,
                verdict: outcome.summary,
            }),
        });
    Ok(trials.collect())
}

/// The text as a regular expression that matches it alone.
fn escaped(text: &str) -> String {
    let mut pattern = String::new();
    for character in text.chars() {
        if character.is_ascii_punctuation() {
            pattern.push('\\');
        }
        pattern.push(character);
    }
    pattern
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
    let mut by_package: BTreeMap<&str, [usize; 3]> = BTreeMap::new();
    for trial in trials {
        let counts = by_package.entry(&trial.package).or_default();
        match trial.verdict {
            Verdict::CaughtMutant | Verdict::Timeout => counts[0] += 1,
            Verdict::MissedMutant => counts[1] += 1,
            _ => counts[2] += 1,
        }
    }
    archive.say(&format!(
        "{} of {drawable} mutants, seed {}.\n",
        trials.len(),
        args.seed
    ));
    archive.say("| package | caught | missed | did not compile |\n|---|---|---|---|");
    let mut total = [0; 3];
    for (package, counts) in &by_package {
        archive.say(&format!(
            "| {package} | {} | {} | {} |",
            counts[0], counts[1], counts[2]
        ));
        for (sum, count) in total.iter_mut().zip(counts) {
            *sum += count;
        }
    }
    let share = total[0] as f64 / (total[0] + total[1]).max(1) as f64;
    archive.say(&format!(
        "| all | {} | {} | {} |\n",
        total[0], total[1], total[2]
    ));
    archive.say(&format!(
        "{:.1} % of those that compile are caught.\n",
        share * 100.0
    ));
    let missed = trials
        .iter()
        .filter(|trial| trial.verdict == Verdict::MissedMutant);
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
            "missed": names(Verdict::MissedMutant),
            "timeout": names(Verdict::Timeout),
        }),
    )?;
    Ok(share)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_name_is_escaped_and_its_place_taken_off() {
        assert_eq!(
            escaped("a/b.rs:1:2: f -> x"),
            "a\\/b\\.rs\\:1\\:2\\: f \\-\\> x"
        );
        assert_eq!(
            without_place("a/b.rs:1:2: replace + with -"),
            "a/b.rs: replace + with -"
        );
        assert_eq!(without_place("a/b.rs:1:2: x::f -> y"), "a/b.rs: x::f -> y");
    }
}
