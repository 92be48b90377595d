//! Runs with the faults and the changes that a robot's description declares, and what is healthy of
//! them.

use vigil_blocks::SensorFrame;
use vigil_learning::channel_learning::{LabelledChange, LabelledRun};
use vigil_recording::frames::Run;
use vigil_recording::labels::Label;
use vigil_robot::Description;
use vigil_terminal::CommandError;

/// What labels say of runs.
#[derive(Debug, Default)]
pub(super) struct Labelled<'a> {
    /// Runs with a fault.
    pub faults: Vec<LabelledRun<'a>>,
    /// Changes in runs that are healthy.
    pub changes: Vec<LabelledChange<'a>>,
}

/// The runs that are labelled with a fault or a change.
///
/// # Errors
/// A run without a label, or with one that `robot` does not declare, or that begins after the run.
pub(super) fn labelled_runs<'a>(
    runs: &'a [Run],
    labels: &'a [Label],
    robot: &Description,
) -> Result<Labelled<'a>, CommandError> {
    let mut found = Labelled::default();
    for run in runs {
        let id = run.id;
        let Some(label) = labels.iter().find(|label| label.run == id) else {
            let message = format!("there is no label of run {id}");
            return Err(CommandError::usage(message));
        };
        let Some(onset_s) = label.onset_s else {
            continue;
        };
        let is_context = is_context(&label.mode, robot);
        if !is_context {
            check_declared(label, robot)?;
        }
        let end_s = run.frames.last().map_or(0.0, time_s);
        if onset_s > end_s {
            let message = format!("run {id} ends at {end_s:.2} s, before its onset at {onset_s} s");
            return Err(CommandError::usage(message));
        }
        if is_context {
            found.changes.push(LabelledChange {
                run: id,
                context: &label.mode,
                onset_s,
            });
        } else {
            found.faults.push(LabelledRun {
                run,
                fault: &label.mode,
                onset_s,
            });
        }
    }
    Ok(found)
}

fn is_context(mode: &str, robot: &Description) -> bool {
    robot.context.iter().any(|context| context.name == mode)
}

fn check_declared(label: &Label, robot: &Description) -> Result<(), CommandError> {
    let faults = robot.fault.iter();
    let declared: Vec<&str> = faults.map(|fault| fault.name.as_str()).collect();
    // Several at once teach nothing of any one of them.
    let modes: Vec<&str> = label.mode.split('+').collect();
    let is_known = |i: usize| declared.contains(&modes[i]) && !modes[..i].contains(&modes[i]);
    if (0..modes.len()).all(is_known) {
        return Ok(());
    }
    let contexts = robot.context.iter();
    let all: Vec<&str> = declared
        .into_iter()
        .chain(contexts.map(|context| context.name.as_str()))
        .collect();
    let declared = match all[..] {
        [] => "none".to_owned(),
        _ => all.join(", "),
    };
    let message = format!(
        "run {} has the mode '{}', which is no [[fault]] of {}, no several of them with a '+' \
         between, each once, and no [[context]]: it declares {declared}",
        label.run, label.mode, robot.name,
    );
    Err(CommandError::usage(message))
}

/// The label as it is scored: a change that is no fault leaves a run healthy.
pub(super) fn as_scored(label: &Label, robot: &Description) -> Label {
    match is_context(&label.mode, robot) {
        true => Label {
            mode: "ND".to_owned(),
            onset_s: None,
            ..label.clone()
        },
        false => label.clone(),
    }
}

/// A run up to its fault.
pub(super) fn healthy_part(run: &Run, faulty: &[LabelledRun<'_>]) -> Run {
    let label = faulty.iter().find(|label| label.run.id == run.id);
    let until_s = label.map_or(f64::INFINITY, |label| label.onset_s);
    let is_before = |frame: &&SensorFrame| time_s(frame) < until_s;
    Run {
        id: run.id,
        frames: run.frames.iter().take_while(is_before).copied().collect(),
    }
}

/// Time of a frame since the recording began, s.
fn time_s(frame: &SensorFrame) -> f64 {
    frame.header.t_capture_ns as f64 * 1e-9
}
