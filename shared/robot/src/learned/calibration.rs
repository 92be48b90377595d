//! Alarm thresholds for a stated mean time between false alarms.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::channels::Channels;
use super::form::Form;
use crate::alarm::AlarmError;
use crate::model_file::ModelError;

/// Tail of the nominal log-odds, from which the alarm threshold follows.
///
/// Exceedances of a level by the log-odds of nominal runs grow rarer exponentially with the level:
/// `interval(h) = interval_at_level · exp(slope (h - level))`. The slope is at most 1 for a filter
/// that knows its model exactly, and smaller when the residuals are not quite white.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Calibration {
    /// Channels for which it holds: `pose` or `pose+encoders`.
    pub sensors: String,
    /// Form of the detection filter for which it holds: `learned-bias`, `constant` or `windowed`.
    pub form: String,
    /// Prior fault rate under which the log-odds were collected, 1/h.
    pub fault_rate_1_h: f64,
    /// Level above which the tail was fitted, natural log-odds.
    pub level_log_odds: f64,
    /// Mean time between exceedances of that level, h.
    pub interval_at_level_h: f64,
    /// Slope of the tail (lower end of its 90 % interval).
    pub tail_slope: f64,
    /// Nominal driving behind the fit, h. A false-alarm interval above it is an extrapolation.
    pub exposure_h: f64,
}

/// Windows over which maxima are taken are independent; at least so many are needed. The median's
/// slope then stands on 15: known within 1.645 / sqrt 15 = 42 %.
const MAXIMA_MIN: usize = 30;
/// A high level is the one that one in so many maxima exceeds, at least [`MAXIMA_MIN`] of them. The
/// top twentieth: 30 maxima beyond it know a slope within 30 %.
const HIGH: usize = 20;
/// Slope taken for a tail that a log is too short to show: half of that of a model without error.
pub const SLOPE_UNKNOWN: f64 = 0.5;
/// Bounds of a slope. At 1 the log-odds of a model without error grow as the logarithm of time; at
/// 0.2 five times as fast, and an alarm a month asks for 17 nats more than one a day.
pub const SLOPE_LIMITS: (f64, f64) = (0.2, 1.0);

/// The calibration of a set of channels and a form of detection among those of a model.
pub(crate) fn find(
    all: &[Calibration],
    channels: Channels,
    form: Form,
) -> Result<&Calibration, ModelError> {
    let (sensors, form) = (channels.name(), form.name());
    all.iter()
        .find(|calibration| calibration.sensors == sensors && calibration.form == form)
        .ok_or_else(|| {
            let known = all
                .iter()
                .map(|c| format!("'{}' and '{}'", c.sensors, c.form));
            let known = known.collect::<Vec<_>>().join(", ");
            ModelError::Calibration {
                sensors,
                form,
                known,
            }
        })
}

impl Calibration {
    /// The threshold for `interval_h` between false alarms, if log-odds up to `reachable` exceed
    /// it.
    pub(crate) fn alarm_below(
        &self,
        reachable: f64,
        form: Form,
        interval_h: f64,
        fault_rate_1_h: f64,
    ) -> Result<f64, AlarmError> {
        let alarm_log_odds = self.alarm_log_odds(interval_h, fault_rate_1_h);
        if alarm_log_odds < reachable {
            return Ok(alarm_log_odds);
        }
        Err(AlarmError::Unreachable {
            form: form.name(),
            interval_h,
            fault_rate_1_h,
            alarm_log_odds,
            reachable_log_odds: reachable,
            interval_max_h: self.interval_h(reachable, fault_rate_1_h),
        })
    }

    /// Log-odds at which to alarm, so that `interval_h` pass on average between false alarms. Not
    /// below 0: an alarm below even odds would be no alarm.
    #[must_use]
    pub fn alarm_log_odds(&self, interval_h: f64, fault_rate_1_h: f64) -> f64 {
        let above = (interval_h / self.interval_at_level_h).ln() / self.tail_slope;
        (self.level_log_odds + above + self.prior(fault_rate_1_h)).max(0.0)
    }

    /// Mean time between exceedances of `alarm_log_odds`, h.
    #[must_use]
    pub fn interval_h(&self, alarm_log_odds: f64, fault_rate_1_h: f64) -> f64 {
        let above = alarm_log_odds - self.level_log_odds - self.prior(fault_rate_1_h);
        self.interval_at_level_h * (self.tail_slope * above).exp()
    }

    /// What another prior fault rate adds to the log-odds.
    fn prior(&self, fault_rate_1_h: f64) -> f64 {
        (fault_rate_1_h / self.fault_rate_1_h).ln()
    }

    /// Fits the tail to the maxima of the log-odds over windows of `window_s` of nominal driving:
    /// exponential exceedances over the median. None if there are fewer than 30 maxima.
    #[must_use]
    pub fn fit(
        channels: Channels,
        form: Form,
        fault_rate_1_h: f64,
        maxima: &mut [f64],
        window_s: f64,
    ) -> Option<Self> {
        if maxima.len() < MAXIMA_MIN || maxima.iter().any(|value| !value.is_finite()) {
            return None;
        }
        maxima.sort_by(f64::total_cmp);
        let level = maxima.get(maxima.len() / 2).copied()?;
        Some(
            Self::blank(channels, form, fault_rate_1_h, maxima.len(), window_s)
                .above(level, maxima),
        )
    }

    /// Fits the tail beyond a high level, which one in 20 maxima, and at least 30, exceed. With
    /// fewer the tail begins at the highest one, with a slope that is not known and so taken low.
    #[must_use]
    pub fn fit_high(
        channels: Channels,
        form: Form,
        fault_rate_1_h: f64,
        maxima: &mut [f64],
        window_s: f64,
    ) -> Self {
        maxima.sort_by(f64::total_cmp);
        let count = maxima.len();
        let blank = Self::blank(channels, form, fault_rate_1_h, count.max(1), window_s);
        let beyond = (count / HIGH).max(MAXIMA_MIN);
        match count.checked_sub(beyond + 1).and_then(|i| maxima.get(i)) {
            Some(&level) => blank.above(level, maxima),
            // No maxima, no level. Chosen: odds far below an alarm's.
            None => Self {
                level_log_odds: maxima.last().copied().unwrap_or(-10.0),
                ..blank
            },
        }
    }

    /// A tail under which the highest maximum, which was seen once, would be rarer than that begins
    /// there.
    #[must_use]
    pub fn not_below(self, highest: f64) -> Self {
        let apart = self.tail_slope * (highest - self.level_log_odds);
        if self.interval_at_level_h * apart.exp() <= self.exposure_h {
            return self;
        }
        Self {
            level_log_odds: highest,
            interval_at_level_h: self.exposure_h,
            ..self
        }
    }

    /// Without a level: one exceedance in all windows, of an unknown slope.
    fn blank(
        channels: Channels,
        form: Form,
        fault_rate_1_h: f64,
        windows: usize,
        window_s: f64,
    ) -> Self {
        let exposure_h = window_s / 3600.0 * windows as f64;
        Self {
            sensors: channels.name().to_owned(),
            form: form.name().to_owned(),
            fault_rate_1_h,
            level_log_odds: 0.0,
            interval_at_level_h: exposure_h,
            tail_slope: SLOPE_UNKNOWN,
            exposure_h,
        }
    }

    /// The exponential tail of the maxima above a level, its slope at the lower end of its 90 %
    /// interval.
    fn above(self, level: f64, maxima: &[f64]) -> Self {
        let apart = maxima.iter().map(|value| value - level);
        let (sum, found) = apart
            .filter(|&x| x > 0.0)
            .fold((0.0, 0.0), |(sum, n), x| (sum + x, n + 1.0));
        let found = f64::max(found, 1.0);
        let lower = 1.0 - 1.645 / found.sqrt();
        Self {
            level_log_odds: level,
            interval_at_level_h: self.exposure_h / found,
            tail_slope: (lower / (sum / found).max(1e-3)).clamp(SLOPE_LIMITS.0, SLOPE_LIMITS.1),
            ..self
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn fit(maxima: &mut [f64], window_s: f64) -> Option<Calibration> {
        Calibration::fit(Channels::Pose, Form::Windowed, 1.0, maxima, window_s)
    }

    #[test]
    fn an_exponential_tail_is_recovered_and_extrapolated() {
        // Quantiles of an exponential with slope .8: the median is ln 2 / .8.
        let n = 4000;
        let mut maxima: Vec<f64> = (0..n)
            .map(|i| -(1.0 - (f64::from(i) + 0.5) / f64::from(n)).ln() / 0.8)
            .collect();
        let fit = fit(&mut maxima, 3.6).unwrap();
        assert_eq!(
            (fit.sensors.as_str(), fit.form.as_str()),
            ("pose", "windowed")
        );
        assert!((fit.level_log_odds - 2.0_f64.ln() / 0.8).abs() < 2e-3);
        let expected = 0.8 * (1.0 - 1.645 / 2000.0_f64.sqrt());
        assert!((fit.tail_slope - expected).abs() < 5e-3, "{fit:?}");
        assert!((fit.exposure_h - 4.0).abs() < 1e-9);
        let threshold = fit.alarm_log_odds(24.0, 1.0);
        let by_hand = fit.level_log_odds + (24.0 / 0.002_f64).ln() / fit.tail_slope;
        assert!((threshold - by_hand).abs() < 0.01);
        assert!((fit.alarm_log_odds(24.0, 2.0) - threshold - 2.0_f64.ln()).abs() < 1e-12);
        for rate in [1.0, 2.0] {
            let alarm = fit.alarm_log_odds(1e6, rate);
            assert!((fit.interval_h(alarm, rate) / 1e6 - 1.0).abs() < 1e-9);
        }
    }

    #[test]
    fn a_high_level_is_taken_where_there_are_maxima_enough() {
        let exponential = |n: u32| -> Vec<f64> {
            let quantile = |i: u32| -(1.0 - (f64::from(i) + 0.5) / f64::from(n)).ln() / 0.8;
            (0..n).map(quantile).collect()
        };
        let fit = |mut maxima: Vec<f64>| {
            Calibration::fit_high(Channels::Pose, Form::Constant, 1.0, &mut maxima, 3.6)
        };
        let long = fit(exponential(4000));
        assert!(
            (long.level_log_odds - 20.0_f64.ln() / 0.8).abs() < 0.01,
            "{long:?}"
        );
        let expected = 0.8 * (1.0 - 1.645 / 200.0_f64.sqrt());
        assert!((long.tail_slope - expected).abs() < 0.02, "{long:?}");
        assert!((long.interval_at_level_h - 0.02).abs() < 1e-9, "{long:?}");
        // Too short for a slope: the highest, seen once in all.
        let short = exponential(20);
        let highest = short.last().copied().unwrap();
        let short = fit(short);
        assert_eq!((short.level_log_odds, short.tail_slope), (highest, 0.5));
        assert!(
            (short.interval_at_level_h - 0.02).abs() < 1e-12,
            "{short:?}"
        );
    }

    #[test]
    fn too_little_data_gives_no_calibration() {
        assert!(fit(&mut [0.0; 29], 1.0).is_none());
        assert!(fit(&mut [f64::NAN; 40], 1.0).is_none());
    }
}
