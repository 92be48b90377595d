//! The tail of the detector's nominal log-odds.

use vigil_robot::Description;
use vigil_robot::learned::Form;
use vigil_robot::learned::monitor::Channels;
use vigil_robot::nominal::channel::FAULT_RATE_1_H;
use vigil_robot::nominal::{Model, Monitor, Tail};

use super::record::Record;
use crate::maxima::Maxima;

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
            let found = maxima.high_tail(Channels::PoseEncoders, form, FAULT_RATE_1_H);
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
            let found = maxima(monitor, records).high_tail(channels, form, FAULT_RATE_1_H);
            model.calibration.push(found);
        }
    }
}

/// Highest log-odds of each window of motion.
fn maxima(mut monitor: Monitor, records: &[Record]) -> Maxima {
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
            maxima.push(monitor.report().log_odds, now.dt_s);
        }
    }
    maxima
}
