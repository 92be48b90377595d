//! `vigil diagnose`: detector and identifier over unlabelled recorded frames.

use std::fs::File;
use std::path::PathBuf;

use vigil_blocks::DetectionBelief;
use vigil_evaluation::scoring::Verdict;
use vigil_learning::plausibility;
use vigil_robot::Description;

use super::offline::{FilterArgs, OfflineModels};
use vigil_terminal::output::Progress;
use vigil_terminal::{CommandError, Outcome};

/// Diagnoses recorded frames without labels and writes one row for each frame.
#[derive(Debug, clap::Args)]
pub struct Args {
    #[command(flatten)]
    filter: FilterArgs,
    /// Where to write the verdicts (CSV).
    #[arg(short, long, value_name = "FILE")]
    out: PathBuf,
}

/// Header of the verdicts.
const COLUMNS: [&str; 16] = [
    "run",
    "t",
    "p_fault",
    "alarm",
    "mode",
    "p_mode",
    "p_unknown",
    "fault_set",
    "p_left_stuck",
    "p_right_stuck",
    "reported",
    "reason",
    "action",
    "size",
    "size_kind",
    "context",
];

/// Writes the verdicts.
///
/// # Errors
/// An input that is refused; an output that cannot be written.
pub fn run(args: &Args) -> Result<Outcome, CommandError> {
    let models = args.filter.prepare()?;
    let OfflineModels { robot, runs, .. } = &models;
    let all = runs.iter().map(|run| (run, f64::INFINITY));
    for warning in plausibility::warnings(all, robot) {
        eprintln!("warning: {}: {warning}", args.filter.frames.display());
    }
    let at_out = |error: &dyn std::fmt::Display| format!("{}: {error}", args.out.display());
    let file = File::create(&args.out).map_err(|e| CommandError::usage(at_out(&e)))?;
    let mut writer = csv::Writer::from_writer(file);
    let mut written = writer.write_record(COLUMNS);
    let progress = Progress::new("runs", runs.len());
    let (set, filter) = (&args.filter.sensors, args.filter.identifier);
    let initial = args.filter.initial(&models, set, filter)?;
    for (done, run) in runs.iter().enumerate() {
        progress.show(done);
        let mut stages = initial.begin()?;
        let mut told = ToldCount::default();
        for frame in &run.frames {
            stages.take(frame);
            let context = told.take(stages.detection(), robot);
            let row = row(run.id, &stages.verdict(frame), context);
            written = written.and_then(|()| writer.write_record(row));
        }
    }
    written
        .and_then(|()| writer.flush().map_err(csv::Error::from))
        .map_err(|error| CommandError::failure(at_out(&error)))?;
    Ok(Outcome::Done)
}

/// Changes that are no fault, told so far.
#[derive(Debug, Default)]
struct ToldCount {
    count: u32,
}

impl ToldCount {
    /// Name of a change that is told now; empty without one.
    fn take(&mut self, belief: &DetectionBelief, robot: &Description) -> String {
        let before = std::mem::replace(&mut self.count, belief.context_count);
        let context = robot.context.get(belief.context as usize);
        let context = context.filter(|_| before != self.count);
        context.map_or_else(String::new, |context| context.name.clone())
    }
}

fn row(run: u32, verdict: &Verdict, context: String) -> [String; 16] {
    let (p, size) = (|value: f64| format!("{value:.6}"), verdict.size);
    [
        run.to_string(),
        verdict.t_s.to_string(),
        p(verdict.p_fault),
        u8::from(verdict.alarm).to_string(),
        verdict.mode.clone(),
        p(verdict.p_mode),
        p(verdict.p_unknown),
        verdict.fault_set.clone(),
        p(verdict.p_left_stuck),
        p(verdict.p_right_stuck),
        verdict.reported.clone(),
        String::new(),
        verdict.action.clone(),
        size.kind.unit().map_or_else(String::new, |_| p(size.value)),
        size.kind.word().to_owned(),
        context,
    ]
}
