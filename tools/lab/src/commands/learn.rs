//! `vigil learn`: learns a robot's model, from labelled runs or healthy ones alone, or shows one.

use std::fmt::Display;
use std::path::{Path, PathBuf};
use vigil_diagnosis::detect;

use schemars::JsonSchema;
use serde::Serialize;
use vigil_learning::channel_learning;
use vigil_learning::learning::further;
use vigil_learning::learning::{self, Options, RESIDUAL_BAR, Report, Residual, View};
use vigil_learning::plausibility;
use vigil_learning::split::split;
use vigil_recording::frames::{self, Run};
use vigil_recording::labels::{self, Label};
use vigil_robot::learned::Model;
use vigil_robot::learned::model::Provenance;
use vigil_robot::{Description, RobotModel};

use super::files::{check_place, file_name, write_whole};
use super::offline::{IntervalArgs, RobotArgs, load_model};
use vigil_terminal::{CommandError, Outcome};

use super::learn_channels;
use super::learn_task::Task;
use vigil_terminal::output;

/// Largest part of the runs that may be left out.
const TEST_FRACTION_MAX: f64 = 0.9;

/// Learns a robot's model from recorded frames, and tests it on held-out runs.
///
/// With `--show`, prints a learned model instead.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Recorded frames (CSV, plain or gzip).
    #[arg(long, value_name = "FILE", required_unless_present = "show")]
    frames: Option<PathBuf>,
    /// Labels of the runs (CSV). Without them every run counts as healthy. A model of channels
    /// learns from them how the faults show that the description declares.
    #[arg(long, value_name = "FILE")]
    runs: Option<PathBuf>,
    /// Frames of healthy runs (CSV) from which a model with faults also learns yaw rate and motor
    /// currents. Default: the healthy runs of --frames, if they hold these channels.
    #[arg(long, value_name = "FILE", requires = "runs")]
    more: Option<PathBuf>,
    /// Runs to learn from: ids separated by commas. Only a model of channels.
    #[arg(long, value_name = "LIST", value_delimiter = ',')]
    only: Vec<u32>,
    /// Learn only from the first S seconds of each run. Only a model of channels.
    #[arg(long, value_name = "S")]
    until: Option<f64>,
    /// Where to write the model (TOML).
    #[arg(short, long, value_name = "FILE", required_unless_present = "show")]
    out: Option<PathBuf>,
    /// Print the model that --model names, and learn nothing.
    #[arg(long, requires = "model", conflicts_with_all = ["frames", "runs", "out"])]
    show: bool,
    /// Learned model to show (TOML).
    #[arg(long, value_name = "MODEL", requires = "show")]
    model: Option<PathBuf>,
    /// Fraction of the runs of every mode and kind to hold out, 0 to 0.9; of a model of channels,
    /// of all runs or, with labels, of their groups.
    #[arg(long, value_name = "SHARE", default_value_t = 0.333, value_parser = test_fraction)]
    test_fraction: f64,
    /// Seed of the split.
    #[arg(long, value_name = "S", default_value_t = 1, value_parser = seed())]
    seed: u64,
    /// Diagnose each group of runs by a model learned from the others, and score that. Only a model
    /// of channels.
    #[arg(long, requires = "runs")]
    cross_validate: bool,
    #[command(flatten)]
    interval: IntervalArgs,
    #[command(flatten)]
    robot: RobotArgs,
    /// Print the report, or the model shown, as one JSON document.
    #[arg(long)]
    json: bool,
}

/// What `learn --show` prints with --json.
#[derive(Debug, Serialize, JsonSchema)]
pub struct ShownModel<'a, V> {
    /// Version of this document.
    schema_version: u32,
    /// Path of the model.
    model: String,
    /// The model, readable.
    #[serde(flatten)]
    view: &'a V,
}

/// What `learn` prints with --json of a model with faults.
#[derive(Debug, Serialize, JsonSchema)]
pub struct Document<'a> {
    /// Version of this document.
    schema_version: u32,
    /// Path of the model written.
    model: String,
    /// Hash of the model, as beliefs and reports carry it.
    model_hash: String,
    /// Seed of the split.
    seed: u64,
    /// What learning found.
    #[serde(flatten)]
    report: &'a Report,
    /// Ids of the runs left out.
    held_out_run_ids: &'a [u32],
}

/// A model file holds whole numbers up to this one.
fn seed() -> clap::builder::RangedU64ValueParser {
    clap::value_parser!(u64).range(0..=i64::MAX.unsigned_abs())
}

fn test_fraction(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(value) if (0.0..=TEST_FRACTION_MAX).contains(&value) => Ok(value),
        _ => Err(format!("allowed is 0 to {TEST_FRACTION_MAX}")),
    }
}

/// Writes the model and prints its error, or shows a model.
///
/// # Errors
/// An input that is refused; an output that cannot be written.
pub fn run(args: &Args) -> Result<Outcome, CommandError> {
    match (&args.model, &args.frames, &args.out) {
        (Some(model), ..) => show(model, args.json),
        (None, Some(frames), Some(out)) => learn(args, frames, out),
        _ => Err(CommandError::usage("--frames and --out are needed")),
    }
}

fn show(path: &Path, is_json: bool) -> Result<Outcome, CommandError> {
    let rate_1_h = detect::Settings::default().fault_rate_1_h;
    match load_model(path)? {
        RobotModel::Faults(model) => print_view(&View::new(&model, rate_1_h), path, is_json),
        RobotModel::Channels(model) => {
            let view = channel_learning::View::new(&model, rate_1_h);
            print_view(&view, path, is_json)
        }
    }
}

fn print_view<V: Serialize + Display>(
    view: &V,
    path: &Path,
    is_json: bool,
) -> Result<Outcome, CommandError> {
    let printed = if is_json {
        output::json(&ShownModel {
            schema_version: 1,
            model: path.display().to_string(),
            view,
        })
    } else {
        output::line(&view.to_string())
    };
    printed.map_err(CommandError::failure)?;
    Ok(Outcome::Done)
}

/// Refuses what only a model of channels can be asked for.
fn refuse_options_of_channels(args: &Args) -> Result<(), CommandError> {
    if args.cross_validate {
        let refused = "--cross-validate: this robot has no model of channels; score the runs \
                       that are left out with `vigil evaluate`";
        return Err(CommandError::usage(refused));
    }
    if !args.only.is_empty() || args.until.is_some() {
        let refused = "--only, --until: this robot has no model of channels; its runs are chosen \
                       by their labels";
        return Err(CommandError::usage(refused));
    }
    Ok(())
}

fn learn(args: &Args, frames_file: &Path, out: &Path) -> Result<Outcome, CommandError> {
    check_place("--out", out)?;
    let robot = args.robot.load()?;
    let Some(labels_file) = args.runs.as_ref().filter(|_| robot.has_fault_models()) else {
        if robot.has_fault_models() {
            let refused = "--runs is needed: the faults of this kind of robot are learned too, and \
                           without labels faulty runs would count as healthy";
            return Err(CommandError::usage(refused));
        }
        return channels(args, frames_file, out, &robot);
    };
    refuse_options_of_channels(args)?;
    let labels = labels::read(labels_file, &robot).map_err(CommandError::usage)?;
    let runs = frames::read(frames_file, &robot).map_err(CommandError::usage)?;
    warn_slow(&runs, &labels, frames_file, &robot);
    let with_frames: Vec<_> = labels
        .iter()
        .filter(|label| runs.iter().any(|run| run.id == label.run))
        .cloned()
        .collect();
    let held_out = split(&with_frames, args.test_fraction, args.seed);
    let options = Options::default();
    let (mut model, mut report) = learning::learn(&runs, &labels, &held_out, &robot, &options)
        .map_err(|error| CommandError::usage(format!("{}: {error}", frames_file.display())))?;
    let terrain = labels::terrain(labels_file, &model.provenance.runs_learned);
    model.provenance = Provenance {
        frames_file: file_name(frames_file),
        labels_file: file_name(labels_file),
        test_fraction: args.test_fraction,
        seed: args.seed,
        terrain: terrain.map_err(CommandError::usage)?,
        software_version: env!("CARGO_PKG_VERSION").to_owned(),
        ..model.provenance
    };
    let healthy = healthy_of(&runs, &labels, &model);
    match &args.more {
        Some(more) => {
            let runs = frames::read(more, &robot).map_err(CommandError::usage)?;
            learn_further(&mut model, &runs.iter().collect::<Vec<_>>(), more, &robot)?;
        }
        None if further::is_in(&healthy, &robot) => {
            learn_further(&mut model, &healthy, frames_file, &robot)?;
        }
        None => {}
    }
    let model = model.sealed();
    report.bounds = learning::bounds::bounds(&model, &robot);
    let text = model.to_toml().map_err(CommandError::failure)?;
    write_whole(out, &text)?;
    let printed = if args.json {
        output::json(&Document {
            schema_version: 1,
            model: out.display().to_string(),
            model_hash: format!("{:016x}", model.hash()),
            seed: args.seed,
            report: &report,
            held_out_run_ids: &model.provenance.runs_held_out,
        })
    } else {
        output::line(&table(&report, out))
    };
    printed
        .map_err(CommandError::failure)
        .map(|()| Outcome::Done)
}

/// Says on the error stream that runs are too slow to be judged.
fn warn_slow(runs: &[Run], labels: &[Label], file: &Path, robot: &Description) {
    let labelled = runs.iter().filter_map(|run| {
        let label = labels.iter().find(|label| label.run == run.id)?;
        Some((run, label.onset_s.unwrap_or(f64::INFINITY)))
    });
    if let Some(warning) = plausibility::slow(labelled, robot) {
        eprintln!("warning: {}: {warning}", file.display());
    }
}

/// The runs without a fault that a model was learned from.
fn healthy_of<'a>(runs: &'a [Run], labels: &[Label], model: &Model) -> Vec<&'a Run> {
    let is_healthy = |run: &&Run| {
        let is_learned = model.provenance.runs_learned.contains(&run.id);
        let mut labels = labels.iter().filter(|label| label.run == run.id);
        is_learned && labels.all(Label::is_nominal)
    };
    runs.iter().filter(is_healthy).collect()
}

/// Learns gyro and currents.
fn learn_further(
    model: &mut Model,
    runs: &[&Run],
    file: &Path,
    robot: &Description,
) -> Result<(), CommandError> {
    further::learn(model, runs, &file_name(file), robot)
        .map_err(|error| CommandError::usage(format!("{}: {error}", file.display())))
}

/// Learns a model of channels.
fn channels(
    args: &Args,
    frames_file: &Path,
    out: &Path,
    robot: &Description,
) -> Result<Outcome, CommandError> {
    let mut runs = frames::read(frames_file, robot).map_err(CommandError::usage)?;
    let ids: Vec<u32> = runs.iter().map(|run| run.id).collect();
    if let Some(id) = args.only.iter().find(|id| !ids.contains(id)) {
        let refused = format!("--only: {} has no run {id}", frames_file.display());
        return Err(CommandError::usage(refused));
    }
    if !args.only.is_empty() {
        runs.retain(|run| args.only.contains(&run.id));
    }
    let labels = match &args.runs {
        Some(file) => Some(labels::read(file, robot).map_err(CommandError::usage)?),
        None => None,
    };
    learn_channels::run(&Task {
        robot,
        runs: &runs,
        frames: frames_file,
        out,
        test_fraction: args.test_fraction,
        seed: args.seed,
        until_s: args.until.unwrap_or(f64::INFINITY),
        false_alarm_interval_h: args.interval.false_alarm_interval,
        cross_validate: args.cross_validate,
        json: args.json,
        labels: labels.as_deref(),
        labels_file: args.runs.as_deref(),
    })
}

fn table(report: &Report, out: &Path) -> String {
    let mut lines = vec![
        format!("model        {}", out.display()),
        format!(
            "learned from {} runs, {} left out",
            report.runs_learned, report.runs_held_out
        ),
        format!(
            "alarms       calibrated on {:.2} h without a fault",
            report.exposure_h
        ),
        String::new(),
        "error of the motion one interval ahead on the runs left out, against the sensor's noise;"
            .into(),
        "in brackets what the model itself predicts of it, as the ground varies within a run"
            .into(),
        format!(
            "{:<10} {:>6} {:>12} {:>11} {:>9} {:>11} {:>6} {:>5} {:>6} {:>7}",
            "mode",
            "poses",
            "position, mm",
            "x noise",
            "yaw, mrad",
            "x noise",
            "",
            "left",
            "right",
            "ln p"
        ),
    ];
    for mode in &report.modes {
        let turn = |turn: &Option<Residual>| match turn {
            Some(turn) => format!("{:.2}", turn.to_floor),
            None => "-".into(),
        };
        let (position, yaw) = (&mode.position, &mode.yaw);
        let floor = |of: &Residual| format!("{:.2} ({:.2})", of.to_floor, of.predicted_to_floor);
        lines.push(format!(
            "{:<10} {:>6} {:>12.2} {:>11} {:>9.2} {:>11} +-{:.2} {:>5} {:>6} {:>7.2}",
            mode.mode,
            mode.poses,
            1e3 * position.rms,
            floor(position),
            1e3 * yaw.rms,
            floor(yaw),
            yaw.to_floor_error,
            turn(&mode.yaw_left),
            turn(&mode.yaw_right),
            mode.log_likelihood,
        ));
    }
    if report.modes.is_empty() {
        lines.push("none: no runs were left out".into());
    }
    let above = report.modes.iter().filter(|mode| !mode.is_within_bar());
    lines.extend(above.map(|mode| {
        format!(
            "{} exceeds {RESIDUAL_BAR} times the sensor's noise",
            mode.mode
        )
    }));
    let bounds = report.bounds.lines();
    if !bounds.is_empty() {
        lines.push(String::new());
        lines.extend(bounds);
    }
    lines.join("\n")
}
