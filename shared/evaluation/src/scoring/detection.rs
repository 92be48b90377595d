//! Was the fault noticed, how soon, and was nothing else?

use serde::Serialize;

use super::{Case, Spread, TIME_SLACK_S, Verdict};

/// Alarms without a fault.
#[derive(Debug, Clone, PartialEq, Default, Serialize)]
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
    /// Time without a fault, h.
    pub exposure_h: f64,
    /// Ids of the runs with a false alarm.
    pub run_ids: Vec<u32>,
}

impl FalseAlarms {
    pub(super) fn of(cases: &[Case]) -> Self {
        let mut found = Self::default();
        for case in cases {
            let onset_s = case.label.onset_s.unwrap_or(f64::INFINITY);
            let nominal: Vec<&Verdict> = case
                .verdicts
                .iter()
                .filter(|verdict| verdict.t_s < onset_s - TIME_SLACK_S)
                .collect();
            if let (Some(first), Some(last)) = (nominal.first(), nominal.last()) {
                found.exposure_h += (last.t_s - first.t_s) / 3600.0;
            }
            let rises = rises(nominal.into_iter()).count();
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
        found
    }
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
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Detection {
    /// Runs with such a fault.
    pub n: usize,
    /// Runs in which the alarm rose at or after the onset.
    pub detected: usize,
    /// The others.
    pub missed: usize,
    /// From the onset to the alarm, of the faults detected.
    pub delay: Spread,
    /// Ids of the runs missed.
    pub missed_run_ids: Vec<u32>,
}

impl Detection {
    pub(super) fn of(cases: &[&Case]) -> Self {
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
            delay: Spread::of(delays),
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
