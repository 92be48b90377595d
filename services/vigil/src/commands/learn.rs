//! `vigil learn`: learns a robot's model, from labelled runs or from healthy ones alone.

use std::fs::{self, File};
use std::io::{self, Write};
use std::path::{Path, PathBuf};

use serde::Serialize;
use vigil_evaluation::frames;
use vigil_evaluation::labels;
use vigil_evaluation::learning::{self, Options, Report};
use vigil_evaluation::split::split;
use vigil_robot::Description;

use super::offline::RobotArgs;
use super::{CommandError, Outcome, learn_nominal};
use crate::output;

/// Largest part of the runs that may be left out.
const TEST_FRACTION_MAX: f64 = 0.9;

/// Learns a robot's model, and tests it on the runs left out.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Recorded frames (CSV, plain or gzip).
    #[arg(long, value_name = "F")]
    frames: PathBuf,
    /// Labels of the runs (CSV). Without them every run counts as one without a fault, and the
    /// model is of nominal behaviour alone.
    #[arg(long, value_name = "R")]
    runs: Option<PathBuf>,
    /// Runs to learn from, by their ids, separated by commas; without labels only.
    #[arg(
        long,
        value_name = "LIST",
        value_delimiter = ',',
        conflicts_with = "runs"
    )]
    only: Vec<u32>,
    /// End of what is learned from in each run, s; without labels only.
    #[arg(long, value_name = "S", conflicts_with = "runs")]
    until: Option<f64>,
    /// Where to write the model (TOML).
    #[arg(long, value_name = "MODEL")]
    out: PathBuf,
    /// Part of the runs of every mode and kind to leave out, 0 to 0.9.
    #[arg(long, value_name = "X", default_value_t = 0.333, value_parser = test_fraction)]
    test_fraction: f64,
    /// Seed of the split and of the detector's calibration.
    #[arg(long, value_name = "S", default_value_t = 1)]
    seed: u64,
    #[command(flatten)]
    robot: RobotArgs,
    /// Print the report as one JSON document.
    #[arg(long)]
    json: bool,
}

#[derive(Debug, Serialize)]
struct Document<'a> {
    schema_version: u32,
    model: String,
    model_hash: String,
    seed: u64,
    #[serde(flatten)]
    report: &'a Report,
    held_out_run_ids: &'a [u32],
}

fn test_fraction(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(value) if (0.0..=TEST_FRACTION_MAX).contains(&value) => Ok(value),
        _ => Err(format!("allowed is 0 to {TEST_FRACTION_MAX}")),
    }
}

/// Writes the model and prints its error.
///
/// # Errors
/// An input that is refused; an output that cannot be written.
pub fn run(args: &Args) -> Result<Outcome, CommandError> {
    let folder = args.out.parent().filter(|f| !f.as_os_str().is_empty());
    if let Some(folder) = folder.filter(|folder| !folder.is_dir()) {
        let refused = format!("--out: there is no folder {}", folder.display());
        return Err(CommandError::usage(refused));
    }
    let robot = args.robot.load()?;
    let Some(labels) = &args.runs else {
        return unlabelled(args, &robot);
    };
    if !robot.has_fault_models() {
        let refused = "--runs: faults are learned for an ackermann6 only; leave the labels out, \
                       and the faulty runs too (--only)";
        return Err(CommandError::usage(refused));
    }
    let labels = labels::read(labels, &robot).map_err(CommandError::usage)?;
    let runs = frames::read(&args.frames, &robot).map_err(CommandError::usage)?;
    let with_frames: Vec<_> = labels
        .iter()
        .filter(|label| runs.iter().any(|run| run.id == label.run))
        .cloned()
        .collect();
    let held_out = split(&with_frames, args.test_fraction, args.seed);
    let options = Options {
        seed: args.seed,
        ..Options::default()
    };
    let (model, report) = learning::learn(&runs, &labels, &held_out, &robot, &options)
        .map_err(|error| CommandError::usage(format!("{}: {error}", args.frames.display())))?;
    let text = model.to_toml().map_err(CommandError::failure)?;
    write_whole(&args.out, &text)
        .map_err(|error| CommandError::failure(format!("{}: {error}", args.out.display())))?;
    let printed = if args.json {
        output::json(&Document {
            schema_version: 1,
            model: args.out.display().to_string(),
            model_hash: format!("{:016x}", model.hash()),
            seed: args.seed,
            report: &report,
            held_out_run_ids: &model.provenance.runs_held_out,
        })
    } else {
        output::line(&table(&report, &args.out))
    };
    printed.map_err(CommandError::failure)?;
    Ok(Outcome::Done)
}

/// Learns from runs without labels.
fn unlabelled(args: &Args, robot: &Description) -> Result<Outcome, CommandError> {
    let mut runs = frames::read(&args.frames, robot).map_err(CommandError::usage)?;
    let ids: Vec<u32> = runs.iter().map(|run| run.id).collect();
    if let Some(id) = args.only.iter().find(|id| !ids.contains(id)) {
        let refused = format!("--only: {} has no run {id}", args.frames.display());
        return Err(CommandError::usage(refused));
    }
    if !args.only.is_empty() {
        runs.retain(|run| args.only.contains(&run.id));
    }
    learn_nominal::run(&learn_nominal::Task {
        robot,
        runs: &runs,
        frames: &args.frames,
        out: &args.out,
        test_fraction: args.test_fraction,
        seed: args.seed,
        until_s: args.until.unwrap_or(f64::INFINITY),
        json: args.json,
    })
}

/// Writes a file so that its place holds either the old one or the whole new one.
pub(super) fn write_whole(path: &Path, text: &str) -> io::Result<()> {
    let mut name = path.as_os_str().to_owned();
    name.push(format!(".{}.part", std::process::id()));
    let part = PathBuf::from(name);
    let write = || {
        let mut file = File::create(&part)?;
        file.write_all(text.as_bytes())?;
        file.sync_all()?;
        fs::rename(&part, path)
    };
    write().inspect_err(|_| {
        // Nothing is left behind; that there may be nothing to remove is no error.
        let _ = fs::remove_file(&part);
    })
}

fn table(report: &Report, out: &Path) -> String {
    let mut lines =
        vec![
        format!("model        {}", out.display()),
        format!("learned from {} runs, {} left out", report.runs_learned, report.runs_held_out),
        format!("alarms       calibrated on {:.2} h without a fault", report.exposure_h),
        String::new(),
        "error of the motion one interval ahead on the runs left out, against the sensor's noise"
            .into(),
        format!(
            "{:<10} {:>8} {:>7} {:>12} {:>8} {:>9} {:>8} {:>10}",
            "mode", "segments", "poses", "position, mm", "x noise", "yaw, mrad", "x noise", "ln p"
        ),
    ];
    for mode in &report.modes {
        lines.push(format!(
            "{:<10} {:>8} {:>7} {:>12.2} {:>8.2} {:>9.2} {:>8.2} {:>10.3}",
            mode.mode,
            mode.segments,
            mode.poses,
            1e3 * mode.position_rms_m,
            mode.position_to_floor,
            1e3 * mode.yaw_rms_rad,
            mode.yaw_to_floor,
            mode.log_likelihood,
        ));
    }
    if report.modes.is_empty() {
        lines.push("none: no runs were left out".into());
    }
    lines.join("\n")
}
