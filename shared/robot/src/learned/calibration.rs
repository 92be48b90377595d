//! Alarm thresholds for a stated mean time between false alarms.

use serde::{Deserialize, Serialize};

use super::form::Form;
use super::monitor::Channels;

/// Tail of the nominal log-odds, from which the alarm threshold follows.
///
/// Exceedances of a level by the log-odds of nominal runs grow rarer exponentially with the level:
/// `interval(h) = interval_at_level · exp(slope (h - level))`. The slope is at most 1 for a filter
/// that knows its nominal model exactly, and smaller when the residuals are not quite white.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
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

/// Bounds of a threshold: an alarm below even odds would be no alarm.
const THRESHOLD: (f64, f64) = (0.0, 60.0);
/// Windows over which maxima are taken are independent; at least so many are needed.
const MAXIMA_MIN: usize = 30;

impl Calibration {
    /// Log-odds at which to alarm, so that `interval_h` pass on average between false alarms.
    #[must_use]
    pub fn alarm_log_odds(&self, interval_h: f64, fault_rate_1_h: f64) -> f64 {
        let above = (interval_h / self.interval_at_level_h).ln() / self.tail_slope;
        let prior = (fault_rate_1_h / self.fault_rate_1_h).ln();
        (self.level_log_odds + above + prior).clamp(THRESHOLD.0, THRESHOLD.1)
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
        let level = maxima[maxima.len() / 2];
        let above: Vec<f64> = maxima
            .iter()
            .map(|value| value - level)
            .filter(|&x| x > 0.0)
            .collect();
        let count = above.len().max(1) as f64;
        let mean = above.iter().sum::<f64>() / count;
        let lower = 1.0 - 1.645 / count.sqrt();
        Some(Self {
            sensors: channels.name().to_owned(),
            form: form.name().to_owned(),
            fault_rate_1_h,
            level_log_odds: level,
            interval_at_level_h: window_s / 3600.0 * maxima.len() as f64 / count,
            tail_slope: (lower / mean.max(1e-3)).clamp(0.2, 1.0),
            exposure_h: window_s / 3600.0 * maxima.len() as f64,
        })
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
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
    }

    #[test]
    fn too_little_data_gives_no_calibration() {
        assert!(fit(&mut [0.0; 29], 1.0).is_none());
        assert!(fit(&mut [f64::NAN; 40], 1.0).is_none());
    }
}
