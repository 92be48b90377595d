//! Which faults a robot's channels show, and which of them they tell apart (isolability).
//!
//! A fault `f` changes the whitened window by its signature `s_f`. Under the joint law with the
//! precision `P` it stands out by `d² = s_f'Ps_f`. What a rival `g` of the best size leaves of that
//! is `d² - (s_f'Ps_g)² / (s_g'Ps_g)` (Basseville and Nikiforov, *Detection of Abrupt Changes*,
//! 1993, chapter 7). Each fault is put into windows of the log itself, whose residuals are added,
//! and judged as the monitor does it: with the law, the threshold and the tails of the model.
//!
//! The sizes are stated, and a fault lasts. Not compared are noise, erratic and missing sensors,
//! and declared faults.

mod candidate;
mod comparison;
mod cover;
mod fault;
mod manoeuvre;
mod report;
mod rule;
mod snapshot;
#[cfg(test)]
mod tests;
mod wait;

use vigil_robot::Description;
use vigil_robot::channel_model::law::Law;
use vigil_robot::channel_model::model::{Class, FAULT_RATE_1_H};
use vigil_robot::channel_model::monitor::component_prior;
use vigil_robot::channel_model::{Model, Scales, components, targets};
use vigil_robot::learned::Form;
use vigil_robot::learned::channels::Channels;

use super::record::Record;
use candidate::candidates;
use comparison::{Comparison, carried};
use cover::cover;
use fault::{Fault, faults};
use manoeuvre::manoeuvres;
pub use report::Isolability;
use report::{AxisCommand, FaultReport, Pair, PairReport, Sensor, TestDrive};
use rule::Rule;
use snapshot::Snapshot;
use wait::Waits;

/// Share of the windows that show a fault from which on it counts as told from a rival at once.
const AT_ONCE: f64 = 0.5;
/// The same below which it is not told at all.
const HARDLY: f64 = 0.05;
/// Share of all windows from which on the motion shows a fault.
const SHOWN: f64 = 0.01;
/// Further sensors, and test drives, that are named.
const MEANS_MAX: usize = 4;
/// Part of what all channels carry from which on one is named.
const CARRIES: f64 = 0.2;

/// What of a log is looked at.
pub(super) struct Task<'a> {
    /// The model.
    pub model: &'a Model,
    /// Its models of the parts' others.
    pub models: &'a [Model],
    /// The log.
    pub records: &'a [Record],
    /// The drives and sizes.
    pub scales: &'a Scales,
    /// The robot.
    pub robot: &'a Description,
    /// Mean time between false alarms, h.
    pub interval_h: f64,
}

/// Compares all faults; none if the model has no law or no alarm, or the log no whole window.
pub(super) fn report(task: &Task<'_>) -> Option<Isolability> {
    let study = Study::new(task)?;
    let sensors = study.sensors();
    let named = |pair: &[usize; 2]| {
        sensors
            .iter()
            .any(|of| of.pairs.contains(&study.pair(*pair)))
    };
    let inseparable = study.never.iter().filter(|pair| !named(pair));
    Some(Isolability {
        false_alarm_interval_h: task.interval_h,
        windows: study.log.len(),
        faults: study.fault_reports(),
        groups: study.groups(),
        slow_pairs: study.slow_pairs(),
        inseparable: inseparable.map(|pair| study.pair(*pair)).collect(),
        test_drives: study.test_drives(),
        sensors,
    })
}

/// All faults of a robot in the windows of its log.
struct Study<'a> {
    task: &'a Task<'a>,
    rule: Rule,
    log: Vec<Snapshot>,
    faults: Vec<Fault>,
    comparison: Comparison,
    /// Pairs that the motion shows and hardly any window tells apart.
    never: Vec<[usize; 2]>,
    /// Pairs that few windows tell apart, those that fewest do first.
    slow: Vec<[usize; 2]>,
}

impl<'a> Study<'a> {
    fn new(task: &'a Task<'a>) -> Option<Self> {
        let Task { model, robot, .. } = *task;
        let targets = targets(robot);
        let mut law = Law::new(&model.direction, targets.len(), 0)?;
        let log = snapshot::of_log(&mut law, task);
        let faults = faults(robot, model, &log);
        let channels = Channels::PoseEncoders;
        let form = (channels, Form::LearnedBias);
        let alarm = model.alarm_log_odds(form, task.interval_h, FAULT_RATE_1_H);
        let tails = Class::ALL.map(|class| model.tail(channels, class).cloned());
        let rule = Rule {
            prior: component_prior(components(robot).len()),
            alarm: alarm.ok()?,
            tails,
            law,
            targets,
        };
        let comparison = Comparison::new(&faults, &log, &rule);
        let (mut never, mut slow) = (Vec::new(), Vec::new());
        let shown = |fault: usize| comparison.seen(fault) >= SHOWN;
        for one in (0..faults.len()).filter(|&one| shown(one)) {
            let others = (one + 1..faults.len()).filter(|&other| shown(other));
            for other in others.filter(|&other| !faults[one].is_whole_of(&faults[other])) {
                let apart = comparison.apart([one, other]);
                if apart < HARDLY {
                    never.push([one, other]);
                } else if apart < AT_ONCE {
                    slow.push([one, other]);
                }
            }
        }
        slow.sort_by(|a, b| comparison.apart(*a).total_cmp(&comparison.apart(*b)));
        (!log.is_empty()).then_some(Self {
            task,
            rule,
            log,
            faults,
            comparison,
            never,
            slow,
        })
    }

    fn pair(&self, pair: [usize; 2]) -> Pair {
        pair.map(|fault| self.faults[fault].name())
    }

    /// Channels that carry most of something, the most important first.
    fn carriers(&self, sums: &[f64]) -> Vec<String> {
        let total: f64 = sums.iter().sum();
        let mut order: Vec<usize> = (0..sums.len()).collect();
        order.retain(|&i| total > 0.0 && sums[i] >= CARRIES * total);
        order.sort_by(|&a, &b| sums[b].total_cmp(&sums[a]));
        order
            .into_iter()
            .map(|i| self.rule.targets[i].name.clone())
            .collect()
    }

    fn fault_reports(&self) -> Vec<FaultReport> {
        let one = |(i, fault): (usize, &Fault)| FaultReport {
            component: fault.component.clone(),
            broken: fault.broken.clone(),
            kind: fault.word(),
            size: fault.stated_size(),
            size_unit: fault.unit.clone(),
            shown_share: self.comparison.seen(i),
            detected_after: Waits::new(&self.log, &self.comparison.detected[i]),
            channels: self.carriers(&self.comparison.carried[i]),
            not_told_from: self.confusions(i),
        };
        self.faults.iter().enumerate().map(one).collect()
    }

    /// Names of the faults that a fault is not told from.
    fn confusions(&self, fault: usize) -> Vec<String> {
        let pairs = self.never.iter().filter(|pair| pair.contains(&fault));
        let others = pairs.flatten().filter(|&&other| other != fault);
        others.map(|&other| self.faults[other].name()).collect()
    }

    /// Sets of faults of which no two are told apart: each fault joins the first that it fits into.
    fn groups(&self) -> Vec<Vec<String>> {
        let mut groups: Vec<Vec<usize>> = Vec::new();
        for fault in 0..self.faults.len() {
            let fits = |group: &&mut Vec<usize>| {
                group.iter().all(|&one| self.never.contains(&[one, fault]))
            };
            match groups.iter_mut().find(fits) {
                Some(group) => group.push(fault),
                None => groups.push(vec![fault]),
            }
        }
        groups.retain(|group| group.len() > 1);
        let names = |group: Vec<usize>| group.into_iter().map(|one| self.faults[one].name());
        groups
            .into_iter()
            .map(|group| names(group).collect())
            .collect()
    }

    /// Pairs that few windows tell apart, and how long it takes.
    fn slow_pairs(&self) -> Vec<PairReport> {
        let carried = carried(&self.slow, &self.faults, &self.log, &self.rule);
        let one = |(pair, carried): (&[usize; 2], Vec<f64>)| {
            let [a, b] = *pair;
            let told = &self.comparison.told;
            let waits = [&told[a][b], &told[b][a]].map(|blocks| Waits::new(&self.log, blocks));
            let slower = |x: Waits, y: Waits| {
                if y.half.motion_s > x.half.motion_s {
                    y
                } else {
                    x
                }
            };
            PairReport {
                pair: self.pair(*pair),
                told_share: self.comparison.apart(*pair),
                told_after: waits.into_iter().flatten().reduce(slower),
                channels: self.carriers(&carried),
            }
        };
        self.slow.iter().zip(carried).map(one).collect()
    }

    /// Further sensors that tell what is not told.
    fn sensors(&self) -> Vec<Sensor> {
        let Task { robot, scales, .. } = *self.task;
        let candidates = candidates(robot, scales, &self.rule.targets);
        let tells = candidate::tells(&candidates, self);
        let one = |cover: cover::Cover| Sensor {
            sensor: candidates[cover.means].name(scales, &self.rule.targets),
            pairs: cover
                .pairs
                .iter()
                .map(|&pair| self.pair(self.never[pair]))
                .collect(),
        };
        cover(&tells, usize::MAX).into_iter().map(one).collect()
    }

    /// Short drives that tell what most of the log does not.
    fn test_drives(&self) -> Vec<TestDrive> {
        let Task { model, scales, .. } = *self.task;
        let drives = manoeuvres(&model.command);
        let mut law = self.rule.law.clone();
        let ends = drives
            .iter()
            .map(|drive| drive.snapshot(model, scales, &mut law));
        let ends: Vec<Snapshot> = ends.collect();
        let pairs = [self.slow.as_slice(), &self.never].concat();
        let tells = manoeuvre::tells(&ends, &pairs, &self.faults, &self.rule);
        let one = |cover: cover::Cover| TestDrive {
            command: AxisCommand::all(&drives[cover.means].command, &model.command),
            duration_s: drives[cover.means].length_s(),
            pairs: cover
                .pairs
                .iter()
                .map(|&pair| self.pair(pairs[pair]))
                .collect(),
        };
        cover(&tells, MEANS_MAX).into_iter().map(one).collect()
    }
}
