//! Runs with the faults that a robot's description declares, and what is healthy of them.

use vigil_blocks::SensorFrame;
use vigil_learning::channel_learning::LabelledRun;
use vigil_recording::frames::Run;
use vigil_recording::labels::Label;
use vigil_robot::Description;
use vigil_terminal::CommandError;

/// The runs that are labelled with a fault.
///
/// # Errors
/// A run without a label, or with that of a fault that `robot` does not declare, or that begins
/// after the run.
pub(super) fn labelled_runs<'a>(
    runs: &'a [Run],
    labels: &'a [Label],
    robot: &Description,
) -> Result<Vec<LabelledRun<'a>>, CommandError> {
    let mut found = Vec::new();
    for run in runs {
        let id = run.id;
        let Some(label) = labels.iter().find(|label| label.run == id) else {
            let message = format!("there is no label of run {id}");
            return Err(CommandError::usage(message));
        };
        let Some(onset_s) = label.onset_s else {
            continue;
        };
        let declared: Vec<&str> = robot
            .fault
            .iter()
            .map(|fault| fault.name.as_str())
            .collect();
        // Several at once teach nothing of any one of them.
        if !label.mode.split('+').all(|mode| declared.contains(&mode)) {
            let declared = match declared[..] {
                [] => "none".to_owned(),
                _ => declared.join(", "),
            };
            let message = format!(
                "run {id} has the mode '{}', which is no [[fault]] of {}: it declares {declared}",
                label.mode, robot.name,
            );
            return Err(CommandError::usage(message));
        }
        let end_s = run.frames.last().map_or(0.0, time_s);
        if onset_s > end_s {
            let message = format!("run {id} ends at {end_s:.2} s, before its onset at {onset_s} s");
            return Err(CommandError::usage(message));
        }
        found.push(LabelledRun {
            run,
            fault: &label.mode,
            onset_s,
        });
    }
    Ok(found)
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
