//! The tails of the log-odds without a fault.

use vigil_robot::Description;
use vigil_robot::channel_model::bank::IMPOSSIBLE;
use vigil_robot::channel_model::model::{Class, FAULT_RATE_1_H, Tail};
use vigil_robot::channel_model::{Model, Monitor};
use vigil_robot::learned::calibration::SLOPE_UNKNOWN;
use vigil_robot::learned::channels::Channels;
use vigil_robot::learned::{Calibration, Form};

use super::record::Record;
use super::unseen::CONTEXT_BLOCKS;
use crate::bounds::Bounds;
use crate::learning::bounds::SLOPE_LIMIT;
use crate::maxima::Maxima;

/// Adds the tail of each class, then, on these, a calibration for each set of channels. Each part
/// of the log is seen through the model that has not seen it.
pub(super) fn fit(
    model: &mut Model,
    models: &mut [Model],
    records: &[Record],
    robot: &Description,
) {
    let mut sets = vec![Channels::PoseEncoders];
    if robot.measured.pose {
        sets.push(Channels::Pose);
    }
    let form = Form::LearnedBias;
    for channels in sets {
        let mut by_class = maxima(models, records, (robot, channels), Monitor::classes);
        let shows = robot.fault.iter().any(|fault| !fault.shows.is_empty());
        // Without a command nothing is late, and nothing is driven.
        let is_there = |class: &Class| match class {
            Class::Shift => shows,
            Class::Late | Class::Drive => !robot.command.is_empty(),
            _ => true,
        };
        let recorded = [Class::Signature, Class::Turning];
        let all = Class::ALL
            .into_iter()
            .filter(|class| !recorded.contains(class));
        let tails = tails(all.filter(is_there), &mut by_class, (channels, form));
        extend(model, models, &tails);
        if !model.signatures.is_empty() {
            // They are seen as live: what is suspected of the other classes is known.
            let mut by_class = maxima(models, records, (robot, channels), Monitor::classes);
            let found = &mut by_class[Class::Signature as usize];
            found.raise(IMPOSSIBLE);
            // One that health never resembles is known no better than its law.
            let signature = Some(Class::Signature).filter(|_| found.vary());
            let tails = self::tails(signature.into_iter(), &mut by_class, (channels, form));
            extend(model, models, &tails);
        }
        let of = |monitor: &Monitor| [monitor.report().log_odds];
        let [mut all] = maxima(models, records, (robot, channels), of);
        let mut found = all.high_tail(channels, form, FAULT_RATE_1_H);
        // Where the log is too short to show it: tempered log-odds have this slope, if those of the
        // classes are right.
        if found.tail_slope == SLOPE_UNKNOWN {
            found.tail_slope = 1.0;
        }
        model.calibration.push(found.not_below(all.highest()));
    }
}

fn extend(model: &mut Model, models: &mut [Model], tails: &[Tail]) {
    for each in models.iter_mut().chain([model]) {
        each.tail.extend(tails.iter().cloned());
    }
}

/// The tails of classes of faults. The same residuals feed all classes but that of noise, and few
/// moments show their tail: they share the least slope.
fn tails(
    classes: impl Iterator<Item = Class>,
    maxima: &mut [Maxima; Class::ALL.len()],
    (channels, form): (Channels, Form),
) -> Vec<Tail> {
    let fitted = classes.map(|class| {
        let found = &mut maxima[class as usize];
        let tail = found.high_tail(channels, form, FAULT_RATE_1_H);
        (class, tail, found.highest())
    });
    let fitted: Vec<_> = fitted.collect();
    let shared = fitted.iter().filter(|(class, ..)| *class != Class::Noise);
    let least = shared
        .map(|(_, tail, _)| tail.tail_slope)
        .fold(f64::INFINITY, f64::min);
    let tail = |(class, mut found, highest): (Class, Calibration, f64)| {
        if class != Class::Noise {
            found.tail_slope = least;
        }
        let found = found.not_below(highest);
        Tail {
            sensors: found.sensors,
            class,
            level_log_odds: found.level_log_odds,
            interval_h: found.interval_at_level_h,
            slope: found.tail_slope,
        }
    };
    fitted.into_iter().map(tail).collect()
}

/// Tells which slopes stand on a bound, or were not learned.
pub(super) fn tell(bounds: &mut Bounds, model: &Model) {
    let tails = model.tail.iter().enumerate();
    let tails = tails.map(|(i, tail)| (format!("tail[{i}].slope"), tail.slope));
    let all = model.calibration.iter().enumerate();
    let all = all.map(|(i, found)| (format!("calibration[{i}].tail_slope"), found.tail_slope));
    for (key, slope) in tails.chain(all) {
        if slope == SLOPE_UNKNOWN {
            let number = (SLOPE_LIMIT.number, key);
            bounds.given(true, number, slope, "the log is too short to show a tail");
        } else {
            bounds.look(&SLOPE_LIMIT, key, slope);
        }
    }
}

/// Highest of each of the log-odds that `of` takes, of each window of motion.
fn maxima<const N: usize>(
    models: &[Model],
    records: &[Record],
    (robot, channels): (&Description, Channels),
    of: impl Fn(&Monitor) -> [f64; N],
) -> [Maxima; N] {
    let mut maxima = [(); N].map(|()| Maxima::new());
    for (fold, model) in models.iter().enumerate() {
        let Some(mut monitor) = Monitor::new(model, robot, channels, FAULT_RATE_1_H) else {
            continue;
        };
        let ahead = CONTEXT_BLOCKS * monitor.bank().window().per_block();
        for record in records {
            maxima.iter_mut().for_each(Maxima::begin);
            let mut is_new = true;
            for (k, history) in record.histories.iter().enumerate() {
                let last = (k + ahead).min(record.folds.len() - 1);
                if !record.folds[k..=last].contains(&fold) {
                    is_new = true;
                    continue;
                }
                if std::mem::take(&mut is_new) {
                    monitor.reset();
                }
                monitor.step(history, &record.orders[k]);
                let Some(now) = history.ago(0).filter(|now| now.moving) else {
                    continue;
                };
                if record.folds[k] == fold && monitor.is_ready() {
                    let pairs = maxima.iter_mut().zip(of(&monitor));
                    pairs.for_each(|(maxima, log_odds)| maxima.push(log_odds, now.dt_s));
                }
            }
        }
    }
    maxima
}
