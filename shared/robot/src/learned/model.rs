//! The model file: written by `vigil learn`, read by detector and identifier.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use vigil_blocks::WHEELS;
use vigil_inference::departure;
use vigil_inference::track::MotionNoise;

use super::calibration::Calibration;
use super::channels::Channels;
use super::compensation;
use super::form::Form;
use super::further::FurtherModel;
use super::motion::{Curve, MotionModel};
pub use super::provenance::Provenance;
use super::wheels::{EncoderModel, RateModel};
use crate::alarm::AlarmError;
use crate::description::Description;
use crate::model_file::{self, ModelFile, check_range, refuse};
pub use crate::model_file::{EDITED, ModelError};

/// Version of the file's layout.
pub const VERSION: u32 = 4;

/// Everything learned about one robot on one kind of ground.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Model {
    /// Layout of the file.
    pub version: u32,
    /// Hash over everything else in the file, so that a file cut short or changed by accident is
    /// noticed: `fnv1a64:` and 16 digits. [`EDITED`] in a file that was changed on purpose.
    pub hash: String,
    /// Name of the robot.
    pub robot: String,
    /// Names of its wheels, in the order of every per-wheel array.
    pub wheels: Vec<String>,
    /// Interval over which frames are averaged into one observation, s.
    pub interval_s: f64,
    /// Where the model comes from.
    pub provenance: Provenance,
    /// Sensor noise per sample at its reference rate.
    pub noise: Noise,
    /// What is known of the command.
    pub command: CommandModel,
    /// Encoders, healthy and broken.
    pub encoder: EncoderModel,
    /// The nominal mode.
    pub nominal: NominalModel,
    /// One model per wheel that may be stuck.
    pub stuck: Vec<StuckModel>,
    /// Gyro and currents, where the frames held them.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub further: Option<FurtherModel>,
    /// Alarm thresholds, one per set of channels and form of the detection filter.
    pub calibration: Vec<Calibration>,
}

/// Standard deviations of the sensors' white noise per sample at the reference rate; at another
/// rate they scale so that the information per second is the same.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Noise {
    /// Rate for which the deviations hold, Hz.
    pub reference_rate_hz: f64,
    /// Position, m.
    pub position_m: f64,
    /// Yaw, rad.
    pub yaw_rad: f64,
    /// Wheel rate, rad/s.
    pub wheel_rate_rad_s: f64,
    /// Steering angle, rad.
    pub steer_rad: f64,
}

/// What is known of the command.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct CommandModel {
    /// Time constant with which the body follows a change of the command, s. Assumed, not learned:
    /// the runs learned from drive one command each.
    pub lag_s: f64,
    /// Uncertainty of the effect of that lag, relative.
    pub lag_uncertainty: f64,
    /// Largest curvature learned from, 1/m.
    pub curvature_max_1_m: f64,
    /// Smallest and largest speed learned from, m/s.
    pub speed_range_m_s: [f64; 2],
    /// Speed below which the robot counts as standing, m/s.
    pub standing_m_s: f64,
}

/// The nominal mode.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct NominalModel {
    /// Standard deviation of steering angles about Ackermann's, sensor noise excluded, rad.
    pub steer_sd_rad: f64,
    /// Motion.
    pub motion: MotionModel,
    /// Wheel rates.
    pub rates: Vec<RateModel>,
}

/// A stuck wheel.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct StuckModel {
    /// Name of the wheel.
    pub wheel: String,
    /// Motion.
    pub motion: MotionModel,
    /// Rates of all wheels; the stuck wheel's own entry is not used.
    pub rates: Vec<RateModel>,
}

impl Model {
    /// Reads and checks a model.
    ///
    /// # Errors
    /// [`ModelError`] naming the key, what was found and what is allowed.
    pub fn from_toml(text: &str) -> Result<Self, ModelError> {
        model_file::read(text)
    }

    /// The file's text.
    ///
    /// # Errors
    /// [`ModelError::Parse`] if the model cannot be written.
    pub fn to_toml(&self) -> Result<String, ModelError> {
        model_file::text(self)
    }

    /// Hash over the content; equal for equal models.
    #[must_use]
    pub fn hash(&self) -> u64 {
        model_file::hash(self)
    }

    /// The same with the hash that its content has, as [`Self::from_toml`] expects it.
    #[must_use]
    pub fn sealed(self) -> Self {
        model_file::sealed(self)
    }

    /// True if the file says that a person has changed it.
    #[must_use]
    pub fn is_edited(&self) -> bool {
        self.hash == EDITED
    }

    /// Checks that the model is of this robot.
    ///
    /// # Errors
    /// [`ModelError::Robot`].
    pub fn check_robot(&self, robot: &Description) -> Result<(), ModelError> {
        let names: Vec<&str> = robot
            .wheels
            .iter()
            .map(|wheel| wheel.name.as_str())
            .collect();
        if self.robot == robot.name && self.wheels == names {
            return Ok(());
        }
        Err(ModelError::Robot {
            model: self.robot.clone(),
            model_wheels: self.wheels.join(" "),
            robot: robot.name.clone(),
            robot_wheels: names.join(" "),
        })
    }

    /// The calibration for a set of channels and a form of detection.
    ///
    /// # Errors
    /// [`ModelError::Calibration`].
    pub fn calibration(&self, channels: Channels, form: Form) -> Result<&Calibration, ModelError> {
        super::calibration::find(&self.calibration, channels, form)
    }

    /// Log-odds at which to alarm, so that `interval_h` pass on average between false alarms at a
    /// prior fault rate of `fault_rate_1_h`.
    ///
    /// # Errors
    /// [`AlarmError`] if there is no calibration, or the log-odds cannot reach the alarm: those of
    /// the pose end at [`departure::LOG_ODDS_MAX`], whatever the other channels do.
    pub fn alarm_log_odds(
        &self,
        (channels, form): (Channels, Form),
        interval_h: f64,
        fault_rate_1_h: f64,
    ) -> Result<f64, AlarmError> {
        let calibration = self.calibration(channels, form)?;
        let reachable = form.log_odds_max().min(departure::LOG_ODDS_MAX);
        calibration.alarm_below(reachable, form, interval_h, fault_rate_1_h)
    }

    /// Noise of nominal motion on any ground that the robot's description allows for.
    #[must_use]
    pub fn nominal_noise(&self, robot: &Description) -> MotionNoise {
        let noise = self.nominal.motion.noise();
        let tolerance = robot.tolerance.as_ref();
        tolerance.map_or(noise, |tolerance| tolerance.widened(&noise))
    }

    /// The model of `wheel` stuck.
    #[must_use]
    pub fn stuck(&self, wheel: usize) -> Option<&StuckModel> {
        let name = self.wheels.get(wheel)?;
        self.stuck.iter().find(|stuck| stuck.wheel == *name)
    }

    /// Gain and offset (1/m) such that a robot with `wheel` stuck, commanded the curvature
    /// `gain·κ + offset`, drives the curvature κ, nearly so for |κ| up to 0.5 /m. (1, 0) if the
    /// model does not know the wheel, or such curvatures cannot be driven with it.
    #[must_use]
    pub fn compensation(&self, wheel: usize) -> (f64, f64) {
        let line = self
            .stuck(wheel)
            .map(|stuck| compensation::line(&stuck.motion));
        line.flatten().unwrap_or((1.0, 0.0))
    }

    /// Variance of one sample of a channel with standard deviation `sd` at the reference rate,
    /// when samples come every `dt_s`.
    #[must_use]
    pub fn sample_variance(&self, sd: f64, dt_s: f64) -> f64 {
        sd * sd / (self.noise.reference_rate_hz * dt_s.max(1e-6))
    }
}

impl ModelFile for Model {
    const VERSION: u32 = VERSION;

    fn stored(&self) -> &str {
        &self.hash
    }

    fn stored_mut(&mut self) -> &mut String {
        &mut self.hash
    }

    fn check(&self) -> Result<(), ModelError> {
        let count = self.wheels.len();
        if count == 0 || count > WHEELS {
            return refuse("wheels", count, "1 to 8 names");
        }
        check_range("interval_s", self.interval_s, 1e-3, 1.0)?;
        let fraction = self.provenance.test_fraction;
        check_range("provenance.test_fraction", fraction, 0.0, 1.0)?;
        self.noise.check()?;
        self.command.check()?;
        let encoder = &self.encoder;
        check_range("encoder.repeat_rate", encoder.repeat_rate, 1e-9, 0.9)?;
        check_range(
            "encoder.resolution_rad_s",
            encoder.resolution_rad_s,
            1e-9,
            1.0,
        )?;
        check_range(
            "encoder.broken_mean_rad_s",
            encoder.broken_mean_rad_s,
            -1e3,
            1e3,
        )?;
        check_range(
            "encoder.broken_sd_rad_s",
            encoder.broken_sd_rad_s,
            1e-3,
            1e3,
        )?;
        check_range("nominal.steer_sd_rad", self.nominal.steer_sd_rad, 0.0, 1.0)?;
        check_motion("nominal.motion", &self.nominal.motion)?;
        check_rates("nominal.rates", &self.nominal.rates, count)?;
        for stuck in &self.stuck {
            let key = format!("stuck.{}", stuck.wheel);
            if !self.wheels.contains(&stuck.wheel) {
                return refuse(&key, &stuck.wheel, "a name listed in wheels");
            }
            check_motion(&key, &stuck.motion)?;
            check_rates(&key, &stuck.rates, count)?;
        }
        if let Some(further) = &self.further {
            further.check(count)?;
        }
        self.calibration.iter().try_for_each(check_calibration)
    }
}

impl Noise {
    fn check(&self) -> Result<(), ModelError> {
        check_range("noise.reference_rate_hz", self.reference_rate_hz, 1e-2, 1e5)?;
        check_range("noise.position_m", self.position_m, 1e-6, 10.0)?;
        check_range("noise.yaw_rad", self.yaw_rad, 1e-6, 1.0)?;
        check_range("noise.wheel_rate_rad_s", self.wheel_rate_rad_s, 1e-6, 10.0)?;
        check_range("noise.steer_rad", self.steer_rad, 1e-6, 1.0)
    }
}

impl CommandModel {
    fn check(&self) -> Result<(), ModelError> {
        check_range("command.lag_s", self.lag_s, 0.0, 5.0)?;
        check_range("command.lag_uncertainty", self.lag_uncertainty, 0.0, 10.0)?;
        check_range(
            "command.curvature_max_1_m",
            self.curvature_max_1_m,
            1e-3,
            1e3,
        )?;
        check_range(
            "command.speed_range_m_s",
            self.speed_range_m_s[0],
            0.0,
            100.0,
        )?;
        check_range(
            "command.speed_range_m_s",
            self.speed_range_m_s[1],
            0.0,
            100.0,
        )?;
        check_range("command.standing_m_s", self.standing_m_s, 1e-4, 10.0)
    }
}

fn check_motion(key: &str, motion: &MotionModel) -> Result<(), ModelError> {
    for (name, curve) in [("yaw", &motion.yaw), ("forward", &motion.forward)] {
        check_curve(&format!("{key}.{name}"), curve)?;
    }
    check_curve(&format!("{key}.lateral"), &motion.lateral)?;
    let floors = [
        ("offset_sd", motion.offset_sd),
        ("deviation_sd", motion.deviation_sd),
    ];
    for (name, values) in floors.into_iter().chain([("white_sd", motion.white_sd)]) {
        for value in values {
            check_range(&format!("{key}.{name}"), value, 0.0, 10.0)?;
        }
    }
    check_range(
        &format!("{key}.correlation"),
        motion.correlation,
        -0.99,
        0.99,
    )?;
    check_range(
        &format!("{key}.deviation_length_m"),
        motion.deviation_length_m,
        1e-3,
        1e3,
    )
}

fn check_curve(key: &str, curve: &Curve) -> Result<(), ModelError> {
    curve
        .terms()
        .into_iter()
        .try_for_each(|value| check_range(key, value, -1e3, 1e3))
}

fn check_rates(key: &str, rates: &[RateModel], count: usize) -> Result<(), ModelError> {
    if rates.len() != count {
        return refuse(format!("{key}.rates"), rates.len(), "one entry per wheel");
    }
    for rate in rates {
        check_range(&format!("{key}.ratio"), rate.ratio, -10.0, 10.0)?;
        for value in rate.droop_rad_s {
            check_range(&format!("{key}.droop_rad_s"), value, -100.0, 100.0)?;
        }
        let sd = rate.rate_sd_rad_s;
        check_range(&format!("{key}.rate_sd_rad_s"), sd, 0.0, 100.0)?;
    }
    Ok(())
}

/// Checks the numbers of a calibration.
pub(crate) fn check_calibration(calibration: &Calibration) -> Result<(), ModelError> {
    let of = format!("calibration.{}.{}", calibration.sensors, calibration.form);
    let key = |name: &str| format!("{of}.{name}");
    check_range(
        &key("fault_rate_1_h"),
        calibration.fault_rate_1_h,
        1e-12,
        1e6,
    )?;
    check_range(
        &key("level_log_odds"),
        calibration.level_log_odds,
        -700.0,
        700.0,
    )?;
    check_range(
        &key("interval_at_level_h"),
        calibration.interval_at_level_h,
        1e-9,
        1e9,
    )?;
    check_range(&key("tail_slope"), calibration.tail_slope, 1e-3, 10.0)?;
    check_range(&key("exposure_h"), calibration.exposure_h, 0.0, 1e9)
}
