//! A learned model for people to read: text, or the same as one document.

use std::fmt::{self, Write as _};

use serde::Serialize;
use vigil_robot::learned::model::{CommandModel, Noise, Provenance};
use vigil_robot::learned::{Calibration, Curve, EncoderModel, Model, MotionModel, RateModel};

/// Radii of the table of heading rates, m.
const RADII_M: [f64; 10] = [1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 9.0, 10.0];
/// Time between false alarms for which thresholds are shown, h.
const INTERVAL_H: f64 = 24.0;

/// A learned model, readable. `Display` prints it as text.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct View {
    /// Robot.
    pub robot: String,
    /// Wheels, in the order of every per-wheel array.
    pub wheels: Vec<String>,
    /// Layout of the file.
    pub layout_version: u32,
    /// Hash of the model, as beliefs and reports carry it.
    pub model_hash: String,
    /// Whether the file says that a person has changed it.
    pub edited: bool,
    /// Where the model comes from.
    pub provenance: Provenance,
    /// Interval over which frames are averaged, s.
    pub interval_s: f64,
    /// What was learned from: largest curvature and range of speeds.
    pub command: CommandModel,
    /// Sensor noise.
    pub noise: Noise,
    /// Encoders, healthy and broken.
    pub encoder: EncoderModel,
    /// One entry per mode, nominal first.
    pub modes: Vec<Mode>,
    /// Speed for which the changes of heading rate hold, m/s.
    pub heading_rate_speed_m_s: f64,
    /// Change of the heading rate by a stuck wheel, one row per radius and turn.
    pub heading_rate_change: Vec<HeadingRate>,
    /// Alarm thresholds.
    pub alarms: Vec<Alarm>,
}

/// One mode.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Mode {
    /// Name.
    pub mode: String,
    /// Motion per commanded metre, with its noise.
    pub motion: MotionModel,
    /// Wheel rates relative to rolling, one per wheel.
    pub rates: Vec<RateModel>,
}

/// Change of the heading rate on one circle.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct HeadingRate {
    /// `left` or `right`.
    pub turn: &'static str,
    /// Commanded radius, m.
    pub radius_m: f64,
    /// For every wheel, if stuck: change relative to the nominal heading rate, percent; positive
    /// is a sharper turn. Null for a wheel that the model does not know.
    pub change_percent: Vec<Option<f64>>,
}

/// Threshold for one set of channels and form of detection.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Alarm {
    /// What was fitted.
    #[serde(flatten)]
    pub calibration: Calibration,
    /// Log-odds that raise an alarm, for 24 h between false alarms.
    pub alarm_log_odds_24_h: f64,
}

impl View {
    /// A view of a model; thresholds for this prior rate of faults.
    #[must_use]
    pub fn new(model: &Model, fault_rate_1_h: f64) -> Self {
        let [slow, fast] = model.command.speed_range_m_s;
        let speed = 0.5 * (slow + fast);
        let mut modes = vec![Mode {
            mode: "ND".into(),
            motion: model.nominal.motion,
            rates: model.nominal.rates.clone(),
        }];
        modes.extend(model.stuck.iter().map(|stuck| Mode {
            mode: format!("{}_STUCK", stuck.wheel),
            motion: stuck.motion,
            rates: stuck.rates.clone(),
        }));
        let turns = [("left", 1.0), ("right", -1.0)];
        let rows = turns.iter().flat_map(|&(turn, sign)| {
            RADII_M.map(|radius_m| heading_rate(model, turn, sign, radius_m, speed))
        });
        let alarm = |calibration: &Calibration| Alarm {
            calibration: calibration.clone(),
            alarm_log_odds_24_h: calibration.alarm_log_odds(INTERVAL_H, fault_rate_1_h),
        };
        Self {
            robot: model.robot.clone(),
            wheels: model.wheels.clone(),
            layout_version: model.version,
            model_hash: format!("{:016x}", model.hash()),
            edited: model.is_edited(),
            provenance: model.provenance.clone(),
            interval_s: model.interval_s,
            command: model.command,
            noise: model.noise,
            encoder: model.encoder,
            modes,
            heading_rate_speed_m_s: speed,
            heading_rate_change: rows.collect(),
            alarms: model.calibration.iter().map(alarm).collect(),
        }
    }
}

fn heading_rate(
    model: &Model,
    turn: &'static str,
    sign: f64,
    radius_m: f64,
    speed: f64,
) -> HeadingRate {
    let limit = model.command.curvature_max_1_m;
    let yaw = |motion: &MotionModel| motion.per_metre(sign / radius_m, speed, limit)[0];
    let nominal = yaw(&model.nominal.motion);
    let change = |wheel: usize| {
        let stuck = model.stuck(wheel)?;
        Some(100.0 * (yaw(&stuck.motion) - nominal) / nominal)
    };
    HeadingRate {
        turn,
        radius_m,
        change_percent: (0..model.wheels.len()).map(change).collect(),
    }
}

impl fmt::Display for View {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.write_source(f)?;
        self.write_ranges(f)?;
        for mode in &self.modes {
            write_mode(f, mode, &self.wheels)?;
        }
        self.write_heading_rates(f)?;
        write!(f, "\nalarms, for {INTERVAL_H} h between false alarms")?;
        for alarm in &self.alarms {
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

impl View {
    fn write_source(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
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
        writeln!(
            f,
            "left out       {} of every mode and kind",
            source.test_fraction
        )?;
        write_runs(f, "runs learned ", &source.runs_learned)?;
        write_runs(f, "runs left out", &source.runs_held_out)
    }

    fn write_ranges(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (command, noise) = (&self.command, &self.noise);
        let ([slow, fast], curved) = (command.speed_range_m_s, command.curvature_max_1_m);
        writeln!(
            f,
            "\nlearned range  curvature to {curved:.3} 1/m, {slow:.3} to {fast:.3} m/s"
        )?;
        writeln!(
            f,
            "command        followed with a lag of {} s, standing below {} m/s",
            command.lag_s, command.standing_m_s
        )?;
        writeln!(
            f,
            "sensor noise   position {:.2} mm, yaw {:.2} mrad, wheels {:.4} rad/s, steering {:.2} \
             mrad a sample at {} Hz",
            1e3 * noise.position_m,
            1e3 * noise.yaw_rad,
            noise.wheel_rate_rad_s,
            1e3 * noise.steer_rad,
            noise.reference_rate_hz
        )?;
        let encoder = &self.encoder;
        writeln!(
            f,
            "encoders       healthy ones repeat a value exactly in {:.2e} of samples, resolution \
             {} rad/s;\n               broken ones read {:.2} +- {:.2} rad/s",
            encoder.repeat_rate,
            encoder.resolution_rad_s,
            encoder.broken_mean_rad_s,
            encoder.broken_sd_rad_s
        )?;
        writeln!(
            f,
            "\nmotion per commanded metre, k the commanded curvature (1/m, left positive), v the \
             speed (m/s);\nsd: constant in a run, varying along the path, white (per root metre)"
        )
    }

    fn write_heading_rates(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let speed = self.heading_rate_speed_m_s;
        writeln!(
            f,
            "\nchange of heading rate by a stuck wheel, %, at {speed:.2} m/s"
        )?;
        write!(f, "{:>5} {:>5}", "turn", "R, m")?;
        for wheel in &self.wheels {
            write!(f, " {wheel:>7}")?;
        }
        for row in &self.heading_rate_change {
            write!(f, "\n{:>5} {:>5}", row.turn, row.radius_m)?;
            for change in &row.change_percent {
                match change {
                    Some(percent) => write!(f, " {percent:>+7.1}")?,
                    None => write!(f, " {:>7}", "-")?,
                }
            }
        }
        writeln!(f)
    }
}

fn write_mode(f: &mut fmt::Formatter<'_>, mode: &Mode, wheels: &[String]) -> fmt::Result {
    let motion = &mode.motion;
    writeln!(f, "\n{}", mode.mode)?;
    let curves = [
        ("yaw, rad", &motion.yaw),
        ("forward, m", &motion.forward),
        ("left, m", &motion.lateral),
    ];
    for (i, (name, curve)) in curves.into_iter().enumerate() {
        let polynomial = polynomial(curve)?;
        writeln!(
            f,
            "  {name:<10} = {polynomial}   sd {:.4}, {:.4}, {:.4}",
            motion.offset_sd[i], motion.deviation_sd[i], motion.white_sd[i]
        )?;
    }
    writeln!(
        f,
        "  varying over {:.2} m, yaw and forward correlated {:+.2}",
        motion.deviation_length_m, motion.correlation
    )?;
    write!(f, "  wheel rates over rolling:")?;
    for (name, rate) in wheels.iter().zip(&mode.rates) {
        write!(f, " {name} {:.3}+-{:.3}", rate.ratio[0], rate.ratio_sd)?;
    }
    writeln!(f)
}

fn polynomial(curve: &Curve) -> Result<String, fmt::Error> {
    let mut text = String::new();
    for (power, c) in curve.curvature.iter().enumerate() {
        match power {
            0 => write!(text, "{c:+.4}")?,
            1 => write!(text, " {c:+.4} k")?,
            _ => write!(text, " {c:+.4} k^{power}")?,
        }
    }
    write!(text, " {:+.4} (1/v - 5)", curve.inverse_speed)?;
    Ok(text)
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
    #![allow(clippy::unwrap_used)]
    use super::*;

    #[test]
    fn runs_are_shown_as_ranges_and_polynomials_with_signs() {
        assert_eq!(ranges(&[7, 1, 2, 3, 9, 10]), ["1-3", "7", "9-10"]);
        assert!(ranges(&[]).is_empty());
        let curve = Curve {
            curvature: [0.2, -0.9, 0.0, 1.0, 0.00004],
            inverse_speed: -0.001,
        };
        assert_eq!(
            polynomial(&curve).unwrap(),
            "+0.2000 -0.9000 k +0.0000 k^2 +1.0000 k^3 +0.0000 k^4 -0.0010 (1/v - 5)"
        );
    }
}
