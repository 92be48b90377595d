//! The tail of the detector's nominal log-odds.

use vigil_recording::frames::Run;
use vigil_recording::labels::Label;
use vigil_robot::Description;
use vigil_robot::learned::channels::Channels;
use vigil_robot::learned::monitor::Monitor;
use vigil_robot::learned::{Form, Model, Observer};

use super::LearnError;
use super::segments::by_run;
use crate::maxima::{Maxima, WINDOW_S};

/// Prior rate under which the log-odds are collected, 1/h.
const FAULT_RATE_1_H: f64 = 1.0;
/// Windows needed.
const WINDOWS_MIN: usize = 30;

/// Runs the detection filter over all nominal driving that was learned from, and stores the tail
/// of its log-odds for each set of channels and each form.
///
/// # Errors
/// [`LearnError::Exposure`] if there is too little of it.
pub fn fit(
    model: &mut Model,
    runs: &[&Run],
    labels: &[Label],
    robot: &Description,
) -> Result<(), LearnError> {
    let labels = by_run(labels);
    let mut driving = Vec::with_capacity(runs.len());
    for run in runs {
        let label = labels.get(&run.id).ok_or(LearnError::Label(run.id))?;
        driving.push((*run, label.onset_s.unwrap_or(f64::INFINITY)));
    }
    for channels in [Channels::Pose, Channels::PoseEncoders] {
        for form in Form::ALL {
            let rate = FAULT_RATE_1_H;
            let monitor = Monitor::new(model, robot, channels, form, rate);
            let mut maxima = maxima(monitor, &driving, robot, model);
            let found_s = maxima.duration_s();
            let fit = maxima.tail(channels, form, rate);
            let needed_s = WINDOWS_MIN as f64 * WINDOW_S;
            model
                .calibration
                .push(fit.ok_or(LearnError::Exposure { found_s, needed_s })?);
        }
    }
    Ok(())
}

/// The same for all channels together, over healthy runs that hold gyro and currents.
///
/// # Errors
/// As [`fit`].
pub fn fit_further(
    model: &mut Model,
    runs: &[&Run],
    robot: &Description,
) -> Result<(), LearnError> {
    let driving: Vec<_> = runs.iter().map(|run| (*run, f64::INFINITY)).collect();
    model
        .calibration
        .retain(|c| c.sensors != Channels::All.name());
    for form in Form::ALL {
        let rate = FAULT_RATE_1_H;
        let monitor = Monitor::new(model, robot, Channels::All, form, rate);
        let mut maxima = maxima(monitor, &driving, robot, model);
        let found_s = maxima.duration_s();
        let needed_s = WINDOWS_MIN as f64 * WINDOW_S;
        let fit = maxima.tail(Channels::All, form, rate);
        model
            .calibration
            .push(fit.ok_or(LearnError::Exposure { found_s, needed_s })?);
    }
    Ok(())
}

/// Highest log-odds of each window of the runs, each up to its time in seconds.
fn maxima(
    mut monitor: Monitor,
    driving: &[(&Run, f64)],
    robot: &Description,
    model: &Model,
) -> Maxima {
    let mut maxima = Maxima::new();
    for (run, until_s) in driving {
        monitor.reset();
        maxima.begin();
        let mut observer = Observer::new(model, robot).with_further();
        for frame in &run.frames {
            if !observer.push(frame).complete {
                continue;
            }
            let observation = *observer.observation();
            if observation.t_ns as f64 * 1e-9 > *until_s {
                break;
            }
            monitor.step(&observation, observer.further(), false);
            if !monitor.is_ready() {
                monitor.forget_evidence();
                continue;
            }
            maxima.push(monitor.report().log_odds, observation.dt_s);
        }
    }
    maxima
}
