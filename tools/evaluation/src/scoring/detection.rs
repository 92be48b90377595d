//! Was the fault noticed, how soon, and was nothing else?

use schemars::JsonSchema;
use serde::Serialize;

use super::{Case, Instants, Spread, TIME_SLACK_S, Verdict, bounds};

/// False alarms an hour, with exact 95 % bounds (Garwood) as if they came independently: several in
/// one run may have one cause. Null without a time.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, JsonSchema)]
pub struct Rate {
    /// False alarms an hour; null without a time.
    pub false_alarms_per_h: Option<f64>,
    /// Lower 95 % bound of the same; null without a time.
    pub lower_95_per_h: Option<f64>,
    /// Upper 95 % bound of the same; null without a time.
    pub upper_95_per_h: Option<f64>,
}

impl Rate {
    pub(super) fn new(alarms: usize, exposure_h: f64) -> Self {
        let an_hour = |events: f64| (exposure_h > 0.0).then(|| events / exposure_h);
        let bounds = bounds::poisson(alarms);
        Self {
            false_alarms_per_h: an_hour(alarms as f64),
            lower_95_per_h: an_hour(bounds.lower),
            upper_95_per_h: an_hour(bounds.upper),
        }
    }
}

/// Alarms without a fault.
#[derive(Debug, Clone, PartialEq, Default, Serialize, JsonSchema)]
pub struct FalseAlarms {
    /// Nominal runs.
    pub nominal_runs: usize,
    /// Nominal runs with an alarm.
    pub nominal_runs_alarmed: usize,
    /// Runs with a fault.
    pub faulty_runs: usize,
    /// Runs with an alarm before the onset of their fault.
    pub faulty_runs_alarmed_before_onset: usize,
    /// Rises of the alarm without a fault.
    pub alarms: usize,
    /// Time without a fault in which an alarm could rise or stood, h.
    pub exposure_h: f64,
    /// Time without a fault in which none could rise, as the detector was warming up, h: at the
    /// beginning of every run. It is no part of the exposure.
    pub warm_up_h: f64,
    /// Alarms over the exposure.
    #[serde(flatten)]
    pub rate: Rate,
    /// Ids of the runs with a false alarm.
    pub run_ids: Vec<u32>,
}

impl FalseAlarms {
    pub(super) fn new(cases: &[Case]) -> Self {
        let mut found = Self::default();
        for case in cases {
            let rises = rises(healthy(case)).count();
            found.alarms += rises;
            let alarmed = usize::from(rises > 0);
            if case.label.is_nominal() {
                found.nominal_runs += 1;
                found.nominal_runs_alarmed += alarmed;
            } else {
                found.faulty_runs += 1;
                found.faulty_runs_alarmed_before_onset += alarmed;
            }
            if alarmed > 0 {
                found.run_ids.push(case.label.run);
            }
        }
        (found.exposure_h, found.warm_up_h) = exposure_h(cases);
        found.rate = Rate::new(found.alarms, found.exposure_h);
        found
    }
}

/// Verdicts without a fault.
fn healthy(case: &Case) -> impl Iterator<Item = &Verdict> {
    let onset_s = case.label.onset_s.unwrap_or(f64::INFINITY);
    let before = move |verdict: &&Verdict| verdict.t_s < onset_s - TIME_SLACK_S;
    case.verdicts.iter().filter(before)
}

/// Time without a fault in all runs, h: that in which an alarm was possible, and that in which the
/// detector was warming up. The time from one verdict to the next counts as the later one does.
pub(super) fn exposure_h(cases: &[Case]) -> (f64, f64) {
    let (mut exposure_s, mut warm_up_s) = (0.0, 0.0);
    for case in cases {
        for (before, now) in healthy(case).zip(healthy(case).skip(1)) {
            match now.warming_up {
                true => warm_up_s += now.t_s - before.t_s,
                false => exposure_s += now.t_s - before.t_s,
            }
        }
    }
    (exposure_s / 3600.0, warm_up_s / 3600.0)
}

/// Verdicts at which the alarm rises.
fn rises<'a>(verdicts: impl Iterator<Item = &'a Verdict>) -> impl Iterator<Item = &'a Verdict> {
    let mut stood = false;
    verdicts.filter(move |verdict| {
        let rose = verdict.alarm && !stood;
        stood = verdict.alarm;
        rose
    })
}

/// Detection of the faults of one class.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct Detection {
    /// Runs with such a fault.
    pub n: usize,
    /// Runs in which the alarm rose at or after the onset.
    pub detected: usize,
    /// Runs in which it did not.
    pub missed: usize,
    /// Runs detected by some time after the onset. Runs that end earlier do not count.
    pub within: Instants,
    /// Time from the onset to the alarm, of the faults detected.
    pub delay: Spread,
    /// Every delay, rising, s.
    pub delays_s: Vec<f64>,
    /// Ids of the runs missed.
    pub missed_run_ids: Vec<u32>,
}

impl Detection {
    pub(super) fn new(cases: &[&Case]) -> Self {
        let (mut delays, mut missed_run_ids) = (Vec::new(), Vec::new());
        for case in cases {
            match delay_s(case) {
                Some(delay_s) => delays.push(delay_s),
                None => missed_run_ids.push(case.label.run),
            }
        }
        Self {
            n: cases.len(),
            detected: delays.len(),
            missed: missed_run_ids.len(),
            within: Instants::new(cases, |case, verdict| {
                let onset_s = case.label.onset_s.unwrap_or(f64::INFINITY);
                let passed_s = verdict.t_s - onset_s + TIME_SLACK_S;
                delay_s(case).is_some_and(|delay_s| delay_s <= passed_s)
            }),
            delays_s: sorted(&delays),
            delay: Spread::new(delays),
            missed_run_ids,
        }
    }
}

fn delay_s(case: &Case) -> Option<f64> {
    let onset_s = case.label.onset_s?;
    let mut after = rises(case.verdicts.iter()).map(|verdict| verdict.t_s - onset_s);
    after
        .find(|delay_s| *delay_s >= -TIME_SLACK_S)
        .map(|delay_s| delay_s.max(0.0))
}

fn sorted(values: &[f64]) -> Vec<f64> {
    let mut values = values.to_vec();
    values.sort_by(f64::total_cmp);
    values
}
