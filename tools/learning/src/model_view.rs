//! What the readable views of learned models have in common: their origin, and their alarms.

use std::fmt;

use schemars::JsonSchema;
use serde::Serialize;
use vigil_robot::learned::Calibration;
use vigil_robot::learned::model::Provenance;

/// Time between false alarms for which thresholds are shown, h.
const INTERVAL_H: f64 = 24.0;

/// What a model is of, and where it comes from.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct Source {
    /// Name of the robot.
    pub robot: String,
    /// Names of its wheels, in the order of every per-wheel array; none for a model of channels.
    pub wheels: Vec<String>,
    /// Version of the file's layout.
    pub layout_version: u32,
    /// Hash of the model, as beliefs and reports carry it.
    pub model_hash: String,
    /// True if the file says that a person has changed it.
    pub edited: bool,
    /// Where the model comes from.
    pub provenance: Provenance,
}

/// Threshold for one set of channels and form of detection.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct Alarm {
    /// What was fitted.
    #[serde(flatten)]
    pub calibration: Calibration,
    /// Log-odds that raise an alarm, for 24 h between false alarms.
    pub alarm_log_odds_24_h: f64,
}

impl Alarm {
    /// Of all calibrations of a model, for this prior rate of faults.
    pub(crate) fn all(calibrations: &[Calibration], fault_rate_1_h: f64) -> Vec<Self> {
        let alarm = |calibration: &Calibration| Self {
            calibration: calibration.clone(),
            alarm_log_odds_24_h: calibration.alarm_log_odds(INTERVAL_H, fault_rate_1_h),
        };
        calibrations.iter().map(alarm).collect()
    }

    /// Writes them as lines, the last one without its end.
    pub(crate) fn write(alarms: &[Self], f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "\nalarms, for {INTERVAL_H} h between false alarms")?;
        for alarm in alarms {
            let Calibration {
                sensors,
                form,
                exposure_h,
                ..
            } = &alarm.calibration;
            let odds = alarm.alarm_log_odds_24_h;
            write!(f, "\n  {sensors:<14} {form:<13} at log-odds {odds:6.2}")?;
            write!(f, ", from {exposure_h:.2} h of nominal driving")?;
        }
        Ok(())
    }
}

impl Source {
    /// Writes it as lines; `left_out_of`: of what a part of the runs was left out.
    pub(crate) fn write(&self, f: &mut fmt::Formatter<'_>, left_out_of: &str) -> fmt::Result {
        let source = &self.provenance;
        let or_none = |text: &str| if text.is_empty() { "not stated" } else { text }.to_owned();
        let edited = if self.edited { ", edited by hand" } else { "" };
        writeln!(
            f,
            "robot          {} ({})",
            self.robot,
            self.wheels.join(" ")
        )?;
        writeln!(f, "file layout    version {}", self.layout_version)?;
        writeln!(f, "model hash     {}{edited}", self.model_hash)?;
        writeln!(f, "data hash      {}", source.data_hash)?;
        writeln!(f, "frames         {}", or_none(&source.frames_file))?;
        writeln!(f, "labels         {}", or_none(&source.labels_file))?;
        writeln!(f, "ground         {}", or_none(&source.terrain))?;
        writeln!(
            f,
            "learned by     vigil {}",
            or_none(&source.software_version)
        )?;
        writeln!(f, "seed           {}", source.seed)?;
        writeln!(f, "left out       {} {left_out_of}", source.test_fraction)?;
        write_runs(f, "runs learned ", &source.runs_learned)?;
        if let Some(until_s) = source.until_s {
            writeln!(f, "of each run    the first {until_s} s")?;
        }
        write_runs(f, "runs left out", &source.runs_held_out)
    }
}

/// Run ids as ranges, in lines of about 80 columns.
fn write_runs(f: &mut fmt::Formatter<'_>, name: &str, runs: &[u32]) -> fmt::Result {
    write!(f, "{name}  {}:", runs.len())?;
    let mut column = 20;
    for range in ranges(runs) {
        if column + range.len() > 90 {
            write!(f, "\n              ")?;
            column = 14;
        }
        write!(f, " {range}")?;
        column += range.len() + 1;
    }
    writeln!(f)
}

/// Rising ids as ranges: `[1, 2, 3, 7]` is `1-3`, `7`.
fn ranges(runs: &[u32]) -> Vec<String> {
    let mut sorted = runs.to_vec();
    sorted.sort_unstable();
    let mut out: Vec<(u32, u32)> = Vec::new();
    for run in sorted {
        match out.last_mut() {
            Some((_, last)) if last.checked_add(1) == Some(run) => *last = run,
            _ => out.push((run, run)),
        }
    }
    let text = |(first, last): (u32, u32)| match first == last {
        true => first.to_string(),
        false => format!("{first}-{last}"),
    };
    out.into_iter().map(text).collect()
}

#[cfg(test)]
mod tests {
    use super::ranges;

    #[test]
    fn runs_are_shown_as_ranges() {
        assert_eq!(ranges(&[7, 1, 2, 3, 9, 10]), ["1-3", "7", "9-10"]);
        assert!(ranges(&[]).is_empty());
    }
}
