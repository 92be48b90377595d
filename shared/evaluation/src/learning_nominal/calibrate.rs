//! The tail of the detector's nominal log-odds.

use vigil_robot::Description;
use vigil_robot::learned::monitor::Channels;
use vigil_robot::learned::{Calibration, Form};
use vigil_robot::nominal::{Model, Monitor, Tail};

use super::record::Record;

/// Windows over which maxima are taken, s.
const WINDOW_S: f64 = 2.0;
/// Prior rate under which the log-odds are collected, 1/h.
const FAULT_RATE_1_H: f64 = 1.0;
/// Slope taken for a tail that a log is too short to show: half of that of a model without error.
const SLOPE_UNKNOWN: f64 = 0.5;

/// The tail begins where one in so many maxima, and at least so many, lie beyond.
const TAIL: usize = 20;
const BEYOND_MIN: usize = 30;
/// Bounds of a slope.
const SLOPE: (f64, f64) = (0.2, 1.0);

/// Adds the tail of each channel for each form, then, on these, a calibration for each set of
/// channels and each form.
pub(super) fn fit(model: &mut Model, records: &[Record], robot: &Description) {
    for i in 0..model.channel.len() {
        let alone = Model {
            channel: model.channel.get(i).cloned().into_iter().collect(),
            ..model.clone()
        };
        for form in Form::ALL {
            let monitor = Monitor::new(&alone, Channels::PoseEncoders, form, FAULT_RATE_1_H);
            let mut maxima = maxima(monitor, records);
            maxima.sort_by(f64::total_cmp);
            let found = tail(Channels::PoseEncoders.name(), form.name(), &maxima);
            model.channel[i].tails.push(Tail {
                form: found.form,
                level_log_odds: found.level_log_odds,
                interval_h: found.interval_at_level_h,
                slope: found.tail_slope,
            });
        }
    }
    let mut sets = vec![Channels::PoseEncoders];
    if robot.measured.pose {
        sets.push(Channels::Pose);
    }
    for channels in sets {
        for form in Form::ALL {
            let monitor = Monitor::new(model, channels, form, FAULT_RATE_1_H);
            let mut maxima = maxima(monitor, records);
            maxima.sort_by(f64::total_cmp);
            let (channels, form) = (channels.name(), form.name());
            model.calibration.push(tail(channels, form, &maxima));
        }
    }
}

/// The tail of sorted maxima: exponential beyond a high level, where there are enough of them; else
/// from the highest on, with a slope that is not known.
fn tail(channels: &str, form: &str, maxima: &[f64]) -> Calibration {
    let count = maxima.len();
    let exposure_h = count.max(1) as f64 * WINDOW_S / 3600.0;
    let beyond = (count / TAIL).max(BEYOND_MIN);
    let highest = maxima.last().copied().unwrap_or(-10.0);
    let (level, interval_h, slope) = match count.checked_sub(beyond + 1).and_then(|i| maxima.get(i))
    {
        None => (highest, exposure_h, SLOPE_UNKNOWN),
        Some(&level) => {
            let above = maxima
                .iter()
                .map(|value| value - level)
                .filter(|&x| x > 0.0);
            let (sum, found) = above.fold((0.0, 0.0), |(sum, n), x| (sum + x, n + 1.0));
            let found = f64::max(found, 1.0);
            let lower = 1.0 - 1.645 / found.sqrt();
            let slope = (lower / (sum / found).max(1e-3)).clamp(SLOPE.0, SLOPE.1);
            (level, exposure_h / found, slope)
        }
    };
    Calibration {
        sensors: channels.to_owned(),
        form: form.to_owned(),
        fault_rate_1_h: FAULT_RATE_1_H,
        level_log_odds: level,
        interval_at_level_h: interval_h,
        tail_slope: slope,
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
