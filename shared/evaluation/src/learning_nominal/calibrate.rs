//! The tail of the detector's nominal log-odds.

use vigil_robot::Description;
use vigil_robot::learned::monitor::Channels;
use vigil_robot::learned::{Calibration, Form};
use vigil_robot::nominal::{Model, Monitor};

use super::record::Record;

/// Windows over which maxima are taken, s.
const WINDOW_S: f64 = 2.0;
/// Prior rate under which the log-odds are collected, 1/h.
const FAULT_RATE_1_H: f64 = 1.0;
/// Slope taken for a tail that a log is too short to show: half of that of a model without error.
const SLOPE_UNKNOWN: f64 = 0.5;

/// Adds a calibration for each set of channels and each form.
pub(super) fn fit(model: &mut Model, records: &[Record], robot: &Description) {
    let mut sets = vec![Channels::PoseEncoders];
    if robot.measured.pose {
        sets.push(Channels::Pose);
    }
    for channels in sets {
        for form in Form::ALL {
            let monitor = Monitor::new(model, channels, form, FAULT_RATE_1_H);
            let mut maxima = maxima(monitor, records);
            let fitted = Calibration::fit(channels, form, FAULT_RATE_1_H, &mut maxima, WINDOW_S);
            let calibration = fitted.unwrap_or_else(|| short(channels, form, &maxima));
            model.calibration.push(calibration);
        }
    }
}

/// From the highest log-odds that a short log shows, with a slope that is not known.
fn short(channels: Channels, form: Form, maxima: &[f64]) -> Calibration {
    let exposure_h = (maxima.len().max(1)) as f64 * WINDOW_S / 3600.0;
    Calibration {
        sensors: channels.name().to_owned(),
        form: form.name().to_owned(),
        fault_rate_1_h: FAULT_RATE_1_H,
        level_log_odds: maxima.iter().copied().fold(-10.0, f64::max),
        interval_at_level_h: exposure_h,
        tail_slope: SLOPE_UNKNOWN,
        exposure_h,
    }
}

/// Highest log-odds of each window of motion.
fn maxima(mut monitor: Monitor, records: &[Record]) -> Vec<f64> {
    let mut maxima = Vec::new();
    for record in records {
        monitor.reset();
        let (mut in_window_s, mut highest) = (0.0, f64::NEG_INFINITY);
        for history in &record.histories {
            monitor.step(history, false);
            if !monitor.is_ready() {
                monitor.forget_evidence();
                continue;
            }
            let Some(now) = history.ago(0).filter(|now| now.moving) else {
                continue;
            };
            highest = monitor.report().log_odds.max(highest);
            in_window_s += now.dt_s;
            if in_window_s >= WINDOW_S {
                maxima.push(highest);
                (in_window_s, highest) = (0.0, f64::NEG_INFINITY);
            }
        }
    }
    maxima
}
