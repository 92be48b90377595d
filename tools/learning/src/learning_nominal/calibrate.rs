//! The tail of the detector's nominal log-odds.

use vigil_robot::Description;
use vigil_robot::learned::Calibration;
use vigil_robot::learned::Form;
use vigil_robot::learned::calibration::SLOPE_UNKNOWN;
use vigil_robot::learned::channels::Channels;
use vigil_robot::nominal::channel::FAULT_RATE_1_H;
use vigil_robot::nominal::{Joint, Model, Monitor, Tail};

use super::record::Record;
use crate::bounds::Bounds;
use crate::learning::bounds::SLOPE_LIMIT;
use crate::maxima::Maxima;

/// Adds the tail of each channel for each form, then that of all channels of a set together, then,
/// on these, a calibration for each set of channels and each form.
pub(super) fn fit(model: &mut Model, records: &[Record], robot: &Description) {
    for i in 0..model.channel.len() {
        let alone = Model {
            channel: model.channel.get(i).cloned().into_iter().collect(),
            ..model.clone()
        };
        for form in Form::ALL {
            let monitor = Monitor::new(&alone, Channels::PoseEncoders, form, FAULT_RATE_1_H);
            let mut maxima = maxima(monitor, records, reported);
            let found = maxima.high_tail(Channels::PoseEncoders, form, FAULT_RATE_1_H);
            model.channel[i].tails.push(tail(found));
        }
    }
    let mut sets = vec![Channels::PoseEncoders];
    if robot.measured.pose {
        sets.push(Channels::Pose);
    }
    for &channels in &sets {
        let form = Form::LearnedBias;
        let monitor = Monitor::new(model, channels, form, FAULT_RATE_1_H);
        if monitor.joint_log_odds().is_some() {
            let together = |monitor: &Monitor| monitor.joint_log_odds().unwrap_or(f64::MIN);
            let mut maxima = maxima(monitor, records, together);
            let found = maxima.high_tail(channels, form, FAULT_RATE_1_H);
            model.joint.push(Joint {
                sensors: channels.name().to_owned(),
                tail: tail(found),
            });
        }
    }
    for channels in sets {
        for form in Form::ALL {
            let monitor = Monitor::new(model, channels, form, FAULT_RATE_1_H);
            let mut maxima = maxima(monitor, records, reported);
            let found = maxima.high_tail(channels, form, FAULT_RATE_1_H);
            model.calibration.push(found);
        }
    }
}

/// Tells which slopes stand on a bound, or were not learned.
pub(super) fn tell(bounds: &mut Bounds, model: &Model) {
    let channels = model.channel.iter().enumerate();
    let tails = channels.flat_map(|(i, channel)| {
        let tails = channel.tails.iter().enumerate();
        tails.map(move |(k, tail)| (format!("channel[{i}].tails[{k}].slope"), tail.slope))
    });
    let joint = model.joint.iter().enumerate();
    let joint = joint.map(|(i, joint)| (format!("joint[{i}].tail.slope"), joint.tail.slope));
    let all = model.calibration.iter().enumerate();
    let all = all.map(|(i, found)| (format!("calibration[{i}].tail_slope"), found.tail_slope));
    for (key, slope) in tails.chain(joint).chain(all) {
        if slope == SLOPE_UNKNOWN {
            let number = (SLOPE_LIMIT.number, key);
            bounds.given(true, number, slope, "the log is too short to show a tail");
        } else {
            bounds.look(&SLOPE_LIMIT, key, slope);
        }
    }
}

fn tail(found: Calibration) -> Tail {
    Tail {
        form: found.form,
        level_log_odds: found.level_log_odds,
        interval_h: found.interval_at_level_h,
        slope: found.tail_slope,
    }
}

/// What a monitor reports.
fn reported(monitor: &Monitor) -> f64 {
    monitor.report().log_odds
}

/// Highest log-odds, as `of` takes them, of each window of motion.
fn maxima(mut monitor: Monitor, records: &[Record], of: fn(&Monitor) -> f64) -> Maxima {
    let mut maxima = Maxima::new();
    for record in records {
        monitor.reset();
        maxima.begin();
        for history in &record.histories {
            monitor.step(history, false);
            if !monitor.is_ready() {
                monitor.forget_evidence();
                continue;
            }
            let Some(now) = history.ago(0).filter(|now| now.moving) else {
                continue;
            };
            maxima.push(of(&monitor), now.dt_s);
        }
    }
    maxima
}
