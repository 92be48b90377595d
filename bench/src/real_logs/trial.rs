//! A run with a fault, and one without, through detector and identifier as they run live.

use std::error::Error;

use serde::Serialize;
use vigil_blocks::{FaultBelief, SensorFrame, SizeKind};
use vigil_diagnosis::Sensors;
use vigil_evaluation::stages::Stages;
use vigil_recording::frames::Run;
use vigil_robot::Description;
use vigil_robot::channel_model::fault_kind::SENSOR_KINDS;
use vigil_robot::channel_model::{Observer, Quantity, targets};

use super::injection::Injection;
use super::split::Split;
use crate::run_time::{period_s, span_s, time_s};
use crate::simulated::stages;

/// Part of a run before the fault.
const ONSET: f64 = 0.4;
/// Time for which a channel must read beyond its tolerance until motion has shown the fault, s.
const SHOWN_S: f64 = 1.0;
/// Time from then on within which it must be found, s.
pub const WITHIN_S: f64 = 5.0;
/// Largest relative error of a size that is right.
const SIZE_ERROR_MAX: f64 = 0.2;
/// A name is said for sure from this probability on.
const SURE: f64 = 0.9;
/// Time between false alarms to which thresholds are set, h.
const INTERVAL_H: f64 = 1.0;

/// What came of a fault.
#[derive(Debug, Clone, Serialize)]
pub struct Trial {
    /// Robot.
    pub robot: String,
    /// Run.
    pub run: u32,
    /// Channel.
    pub channel: String,
    /// Kind and size.
    pub fault: String,
    /// Time from the onset until motion has shown it, s; none if it did not, or the run ended
    /// before an alarm was due.
    pub shown_s: Option<f64>,
    /// Time from the onset to the alarm, s.
    pub alarm_s: Option<f64>,
    /// True if its leaf was named in time.
    pub named: bool,
    /// True if the kind was right with the name.
    pub kind: bool,
    /// True if the size was right with the kind; none for a fault that has no size.
    pub size: Option<bool>,
    /// True if another leaf was named for sure.
    pub wrong: bool,
}

impl Trial {
    /// True if it had an alarm in time.
    #[must_use]
    pub fn is_detected(&self) -> bool {
        let due_s = self.shown_s.map(|shown_s| shown_s + WITHIN_S);
        matches!((self.alarm_s, due_s), (Some(alarm_s), Some(due_s)) if alarm_s <= due_s)
    }
}

/// Alarms without a fault.
#[derive(Debug, Clone, Copy, Serialize)]
pub struct Healthy {
    /// Alarms.
    pub alarms: u32,
    /// Time watched, h.
    pub hours: f64,
}

/// The judged runs as they are.
///
/// # Errors
/// Stages that cannot be made.
pub fn healthy(split: &Split) -> Result<Healthy, Box<dyn Error>> {
    let mut found = Healthy {
        alarms: 0,
        hours: 0.0,
    };
    for run in &split.judged {
        let mut stages = begin(split, run)?;
        let mut stood = false;
        for frame in &run.frames {
            stages.take(frame);
            let stands = stages.detection().alarm != 0;
            found.alarms += u32::from(stands && !stood);
            stood = stands;
        }
        found.hours += length_s(run) / 3600.0;
    }
    Ok(found)
}

/// A run with a fault.
///
/// # Errors
/// Stages that cannot be made.
pub fn trial(
    split: &Split,
    run: &Run,
    injection: &Injection,
    tolerance: f64,
) -> Result<Trial, Box<dyn Error>> {
    let robot = split.robot();
    let all = targets(robot);
    let target = &all[injection.channel];
    let onset_s = span_s(run)[0] + ONSET * length_s(run);
    let broken = injection.frames(run, robot, target, onset_s);
    let mut stages = begin(split, run)?;
    let mut rule = Rule::new(robot);
    let tree = &split.setup.tree;
    let node = tree
        .index(target.component())
        .ok_or("the tree lacks a leaf")?;
    let group = tree.nodes()[node].parent;
    let truth = Truth { node, group };
    let mut trial = Trial {
        robot: robot.name.clone(),
        run: run.id,
        channel: target.name.clone(),
        fault: injection.name.clone(),
        shown_s: None,
        alarm_s: None,
        named: false,
        kind: false,
        size: injection.change.size().map(|_| false),
        wrong: false,
    };
    for (whole, frame) in run.frames.iter().zip(&broken) {
        stages.take(frame);
        let after_s = time_s(frame) - onset_s;
        if after_s < 0.0 {
            continue;
        }
        let apart = rule.apart([whole, frame], injection.channel, tolerance);
        if trial.shown_s.is_none() && apart >= SHOWN_S {
            trial.shown_s = Some(after_s);
        }
        if stages.detection().alarm == 0 {
            continue;
        }
        trial.alarm_s.get_or_insert(after_s);
        let diagnosis = stages.diagnosis();
        trial.wrong |= truth.is_wrong(diagnosis);
        let in_time = trial
            .shown_s
            .is_none_or(|shown| after_s <= shown + WITHIN_S);
        if in_time && diagnosis.mode == truth.node as u32 {
            trial.named = true;
            judge(&mut trial, injection, diagnosis, target.quantity);
        }
    }
    // A run that ends before an alarm is due shows nothing.
    let end_s = (1.0 - ONSET) * length_s(run);
    if trial.alarm_s.is_none() && trial.shown_s.is_some_and(|s| s + WITHIN_S > end_s) {
        trial.shown_s = None;
    }
    Ok(trial)
}

/// The stages at the beginning of a run.
fn begin(split: &Split, run: &Run) -> Result<Stages, Box<dyn Error>> {
    let mut setup = split.setup.clone();
    setup.file.detector.false_alarm_interval_h = INTERVAL_H;
    let rate_hz = 1.0 / period_s(run);
    stages(&setup, Sensors::PoseEncoders, rate_hz, u64::from(run.id))
}

fn length_s(run: &Run) -> f64 {
    let [first_s, last_s] = span_s(run);
    last_s - first_s
}

/// For how long a broken channel has been beyond its tolerance of what it would have read.
struct Rule {
    whole: Observer,
    broken: Observer,
    apart_s: f64,
}

impl Rule {
    fn new(robot: &Description) -> Self {
        Self {
            whole: Observer::new(robot),
            broken: Observer::new(robot),
            apart_s: 0.0,
        }
    }

    /// Takes the same frame `[whole, broken]`.
    fn apart(&mut self, frames: [&SensorFrame; 2], channel: usize, tolerance: f64) -> f64 {
        self.whole.push(frames[0]);
        if self.broken.push(frames[1]).complete {
            let newest = [&self.whole, &self.broken].map(|of| of.history().ago(0));
            if let [Some(whole), Some(broken)] = newest
                && let (Some(a), Some(b)) = (whole.values[channel], broken.values[channel])
                && (a - b).abs() > tolerance
            {
                self.apart_s += broken.dt_s;
            }
        }
        self.apart_s
    }
}

/// What should be named.
struct Truth {
    /// Node of the broken component.
    node: usize,
    /// The node above it.
    group: Option<usize>,
}

impl Truth {
    /// True if another component is named for sure.
    fn is_wrong(&self, diagnosis: &FaultBelief) -> bool {
        let mode = diagnosis.mode as usize;
        let is_node = mode > 0 && mode < diagnosis.node_count as usize;
        let is_right = mode == self.node || Some(mode) == self.group;
        is_node && !is_right && diagnosis.p_mode > SURE
    }
}

/// Compares kind and size of a right name with the fault.
fn judge(trial: &mut Trial, injection: &Injection, diagnosis: &FaultBelief, of: Quantity) {
    let said = SizeKind::from_wire(diagnosis.size_kind[diagnosis.mode as usize]);
    let kinds = SENSOR_KINDS.into_iter();
    let mut kinds = kinds.filter(|kind| injection.change.is_of(*kind));
    let kind = kinds.any(|kind| kind.size_kind(Some(of)) == said);
    trial.kind |= kind;
    if let (true, Some(size)) = (kind, injection.change.size()) {
        let error = (diagnosis.size[diagnosis.mode as usize] / size - 1.0).abs();
        // The last size that is said in time counts.
        trial.size = Some(error <= SIZE_ERROR_MAX);
    }
}
