//! The tail of the detector's nominal log-odds.

use vigil_robot::Description;
use vigil_robot::learned::monitor::{Channels, Monitor};
use vigil_robot::learned::{Calibration, Model};

use super::segments::{by_run, observations};
use super::{LearnError, Options};
use crate::frames::Run;
use crate::labels::Label;

/// Windows over which maxima are taken, s.
const WINDOW_S: f64 = 2.0;
/// The detector arms after this time, s.
const ARM_S: f64 = 1.0;
/// Prior rate under which the log-odds are collected, 1/h.
const FAULT_RATE_1_H: f64 = 1.0;
/// Windows needed.
const WINDOWS_MIN: usize = 30;

/// Runs the detection filter over all nominal driving that was learned from, and stores the tail
/// of its log-odds for each set of channels.
///
/// # Errors
/// [`LearnError::Exposure`] if there is too little of it.
pub fn fit(
    model: &mut Model,
    runs: &[&Run],
    labels: &[Label],
    robot: &Description,
    options: &Options,
) -> Result<(), LearnError> {
    let labels = by_run(labels);
    for channels in [Channels::Pose, Channels::PoseEncoders] {
        let mut maxima = Vec::new();
        let mut monitor = Monitor::new(
            model,
            robot,
            channels,
            options.particles,
            FAULT_RATE_1_H,
            options.seed,
        );
        for run in runs {
            let label = labels.get(&run.id).ok_or(LearnError::Label(run.id))?;
            let onset = label.onset_s.unwrap_or(f64::INFINITY);
            monitor.reset();
            let (mut run_s, mut in_window_s, mut highest) = (0.0, 0.0, f64::NEG_INFINITY);
            for observation in observations(run, robot, model) {
                if observation.t_ns as f64 * 1e-9 > onset {
                    break;
                }
                monitor.step(&observation, false);
                run_s += observation.dt_s;
                if run_s < ARM_S {
                    monitor.forget_evidence();
                    continue;
                }
                highest = monitor.report().log_odds.max(highest);
                in_window_s += observation.dt_s;
                if in_window_s >= WINDOW_S {
                    maxima.push(highest);
                    (in_window_s, highest) = (0.0, f64::NEG_INFINITY);
                }
            }
        }
        let found_s = maxima.len() as f64 * WINDOW_S;
        let fit = Calibration::fit(channels.name(), FAULT_RATE_1_H, &mut maxima, WINDOW_S);
        let needed_s = WINDOWS_MIN as f64 * WINDOW_S;
        model
            .calibration
            .push(fit.ok_or(LearnError::Exposure { found_s, needed_s })?);
    }
    Ok(())
}
