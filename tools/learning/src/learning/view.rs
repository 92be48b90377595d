//! A learned model for people to read: text, or the same as one document.

use std::fmt::{self, Write as _};

use schemars::JsonSchema;
use serde::Serialize;
use vigil_robot::learned::model::{CommandModel, Noise};
use vigil_robot::learned::{Curve, EncoderModel, Model, MotionModel, RateModel};

use crate::model_view::{Alarm, Source};

/// Radii of the table of heading rates, m.
const RADII_M: [f64; 10] = [1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 9.0, 10.0];

/// A learned model, readable. `Display` prints it as text.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct View {
    /// What it is of, and where it comes from.
    #[serde(flatten)]
    pub source: Source,
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
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct Mode {
    /// Name of the mode.
    pub mode: String,
    /// Motion per commanded metre, with its noise.
    pub motion: MotionModel,
    /// Wheel rates relative to rolling, one per wheel.
    pub rates: Vec<RateModel>,
}

/// Change of the heading rate on one circle.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct HeadingRate {
    /// `left` or `right`.
    pub turn: &'static str,
    /// Commanded radius, m.
    pub radius_m: f64,
    /// For every wheel, if stuck: change relative to the nominal heading rate, percent; positive
    /// is a sharper turn. Null for a wheel that the model does not know.
    pub change_percent: Vec<Option<f64>>,
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
        let source = Source {
            robot: model.robot.clone(),
            wheels: model.wheels.clone(),
            layout_version: model.version,
            model_hash: format!("{:016x}", model.hash()),
            edited: model.is_edited(),
            provenance: model.provenance.clone(),
        };
        Self {
            source,
            interval_s: model.interval_s,
            command: model.command,
            noise: model.noise,
            encoder: model.encoder,
            modes,
            heading_rate_speed_m_s: speed,
            heading_rate_change: rows.collect(),
            alarms: Alarm::all(&model.calibration, fault_rate_1_h),
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
        self.source.write(f, "of every mode and kind")?;
        self.write_ranges(f)?;
        for mode in &self.modes {
            write_mode(f, mode, &self.source.wheels)?;
        }
        self.write_heading_rates(f)?;
        Alarm::write(&self.alarms, f)
    }
}

impl View {
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
        for wheel in &self.source.wheels {
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
    write!(f, "  wheel rates over rolling, less droop (rad/s):")?;
    for (name, rate) in wheels.iter().zip(&mode.rates) {
        let (droop, sd) = (rate.droop_rad_s[0], rate.rate_sd_rad_s);
        write!(f, " {name} {:.3} {droop:.3}+-{sd:.3}", rate.ratio)?;
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn polynomials_are_shown_with_signs() {
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
