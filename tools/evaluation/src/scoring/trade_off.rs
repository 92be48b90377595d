//! How much sooner would faults be found if more false alarms were allowed?
//!
//! The activity monitoring curve of Fawcett and Provost (1999): detection delay against false
//! alarms, over all thresholds on the detector's log-odds, all from one pass. At each threshold
//! the alarm rises and falls as the detector's own does, so that it is armed again after each; at
//! the configured threshold the curve says what was measured. Above it delays may come out too
//! long: once its own alarm stands, the detector's pose track follows the measurement, which slows
//! the growth of the log-odds. Time at rest counts as time in motion here; while the detector warms
//! up, no alarm rises at any threshold.

use std::collections::BTreeMap;

use schemars::JsonSchema;
use serde::Serialize;
use vigil_robot::Alarm;

use super::detection::{Rate, exposure_h};
use super::{Case, Spread, TIME_SLACK_S, Taxonomy, Verdict};

/// Thresholds taken from the top of healthy driving, as many from the rest of it, and as many from
/// driving with a fault.
const LEVELS: usize = 30;

/// Detection of the faults of one class at one threshold.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct ClassDetection {
    /// Number of faults.
    pub n: usize,
    /// Faults at or after whose onset the alarm rises; one that stands before is no detection.
    pub detected: usize,
    /// Share of the faults not detected; null without a fault.
    pub miss_rate: Option<f64>,
    /// Mean delay of the detected, s; null without one.
    pub delay_mean_s: Option<f64>,
    /// Delay of the detected.
    pub delay: Spread,
}

impl ClassDetection {
    fn new(n: usize, delays_s: Vec<f64>) -> Self {
        let detected = delays_s.len();
        let mean_s = delays_s.iter().sum::<f64>() / detected as f64;
        Self {
            n,
            detected,
            miss_rate: (n > 0).then(|| (n - detected) as f64 / n as f64),
            delay_mean_s: (detected > 0).then_some(mean_s),
            delay: Spread::new(delays_s),
        }
    }
}

/// One threshold.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct Point {
    /// The alarm rises above these log-odds, nats.
    pub threshold_log_odds: f64,
    /// Rises of the alarm without a fault.
    pub false_alarms: usize,
    /// The same an hour.
    #[serde(flatten)]
    pub rate: Rate,
    /// Detection by type of fault; `all` is every one.
    pub detection: BTreeMap<String, ClassDetection>,
}

/// Detection at all thresholds.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct TradeOff {
    /// The threshold that was set.
    pub configured: Point,
    /// Thresholds, rising. They are log-odds that a run reaches for the first time, where the
    /// curve changes: the highest of healthy driving, where false alarms are few, and others evenly
    /// thinned by rank.
    pub points: Vec<Point>,
}

impl TradeOff {
    pub(super) fn new(cases: &[Case], taxonomy: &Taxonomy, alarm_log_odds: f64) -> Self {
        let (exposure_h, _) = exposure_h(cases);
        let point = |threshold| point(cases, taxonomy, exposure_h, threshold);
        Self {
            configured: point(alarm_log_odds),
            points: thresholds(cases).into_iter().map(point).collect(),
        }
    }
}

/// Times at which the alarm rises at `threshold`, s.
fn rises_s(verdicts: &[Verdict], threshold: f64) -> Vec<f64> {
    let (mut rises_s, mut alarm) = (Vec::new(), Alarm::new(threshold));
    let mut last_s = verdicts.first().map_or(0.0, |first| first.t_s);
    for verdict in verdicts {
        let dt_s = verdict.t_s - last_s;
        last_s = verdict.t_s;
        if !verdict.warming_up && alarm.take(verdict.log_odds, dt_s, true) {
            rises_s.push(verdict.t_s);
        }
    }
    rises_s
}

fn point(cases: &[Case], taxonomy: &Taxonomy, exposure_h: f64, threshold: f64) -> Point {
    let mut false_alarms = 0;
    let mut classes: BTreeMap<String, (usize, Vec<f64>)> = BTreeMap::new();
    for case in cases {
        let rises_s = rises_s(&case.verdicts, threshold);
        let onset_s = case.label.onset_s.unwrap_or(f64::INFINITY) - TIME_SLACK_S;
        let early = rises_s.iter().take_while(|t_s| **t_s < onset_s).count();
        false_alarms += early;
        if case.label.is_nominal() {
            continue;
        }
        let delay_s = rises_s.get(early).map(|t_s| t_s - onset_s - TIME_SLACK_S);
        for class in ["all", taxonomy.class_or_unmodelled(&case.label.mode)] {
            let (n, delays_s) = classes.entry(class.to_owned()).or_default();
            *n += 1;
            delays_s.extend(delay_s.map(|delay_s| delay_s.max(0.0)));
        }
    }
    let found = classes
        .into_iter()
        .map(|(class, (n, delays_s))| (class, ClassDetection::new(n, delays_s)));
    Point {
        threshold_log_odds: threshold,
        false_alarms,
        rate: Rate::new(false_alarms, exposure_h),
        detection: found.collect(),
    }
}

/// Log-odds at which a first alarm changes, in healthy driving and with a fault, thinned.
fn thresholds(cases: &[Case]) -> Vec<f64> {
    let (mut healthy, mut faulty) = (Vec::new(), Vec::new());
    for case in cases {
        let onset_s = case.label.onset_s.unwrap_or(f64::INFINITY) - TIME_SLACK_S;
        let (mut highest, mut highest_faulty) = (f64::NEG_INFINITY, f64::NEG_INFINITY);
        for verdict in case.verdicts.iter().filter(|v| !v.warming_up) {
            let (levels, highest) = match verdict.t_s < onset_s {
                true => (&mut healthy, &mut highest),
                false => (&mut faulty, &mut highest_faulty),
            };
            if verdict.log_odds > *highest && verdict.log_odds.is_finite() {
                *highest = verdict.log_odds;
                levels.push(verdict.log_odds);
            }
        }
    }
    // Highest first: each of these is one false alarm more.
    healthy.sort_by(|a, b| b.total_cmp(a));
    healthy.dedup();
    let rest = healthy.split_off(healthy.len().min(LEVELS));
    let mut levels = [healthy, thinned(rest), thinned(faulty)].concat();
    levels.sort_by(f64::total_cmp);
    levels.dedup();
    levels
}

/// At most [`LEVELS`] of the values, evenly by rank, the least and the largest among them.
fn thinned(mut values: Vec<f64>) -> Vec<f64> {
    values.sort_by(f64::total_cmp);
    values.dedup();
    let n = values.len();
    if n <= LEVELS {
        return values;
    }
    let at = |i: usize| i * (n - 1) / (LEVELS - 1);
    (0..LEVELS)
        .filter_map(|i| values.get(at(i)).copied())
        .collect()
}
