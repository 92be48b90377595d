//! The alarm: at which log-odds it rises, and when it falls again.

use vigil_checkpoint::CheckpointValue;

use crate::model_file::ModelError;

/// Distance below the threshold at which an alarm falls, nats. Chosen: a factor of 150 on the odds;
/// at half of it the wander of a healthy robot's log-odds toggles an alarm near its threshold.
const CLEAR_BELOW: f64 = 5.0;
/// Log-odds above which no alarm falls, whatever the threshold. Chosen: a probability of 1.8 %.
const CLEAR_LOG_ODDS: f64 = -4.0;
/// Time for which the log-odds must be that low, s. Chosen: twenty 50 ms observations in a
/// row. Shorter, and a lull ends the alarm of a lasting fault; longer keeps that of a mended one.
const CLEAR_S: f64 = 1.0;
/// Slack when that time is compared, s: it is a sum of short intervals.
const TIME_SLACK_S: f64 = 1e-6;

/// For how long log-odds have been as low as those that end an alarm.
#[derive(Debug, Clone, Copy, Default, PartialEq, CheckpointValue)]
pub struct Lull {
    quiet_s: f64,
}

impl Lull {
    /// Takes the log-odds of the last `dt_s`, about an alarm that rises above `threshold_log_odds`;
    /// true once they have been low for a second. What is not low begins the second anew.
    pub fn take(&mut self, log_odds: f64, threshold_log_odds: f64, dt_s: f64) -> bool {
        let low = (threshold_log_odds - CLEAR_BELOW).min(CLEAR_LOG_ODDS);
        self.quiet_s = if log_odds < low {
            self.quiet_s + dt_s
        } else {
            0.0
        };
        self.quiet_s >= CLEAR_S - TIME_SLACK_S
    }
}

/// An alarm that rises above a threshold and falls once the log-odds have been low for a second.
#[derive(Debug, Clone, Copy, PartialEq, CheckpointValue)]
pub struct Alarm {
    threshold_log_odds: f64,
    stands: bool,
    lull: Lull,
}

impl Alarm {
    /// An alarm that does not stand, and rises above these natural log-odds.
    #[must_use]
    pub const fn new(threshold_log_odds: f64) -> Self {
        Self {
            threshold_log_odds,
            stands: false,
            lull: Lull { quiet_s: 0.0 },
        }
    }

    /// Log-odds above which it rises.
    #[must_use]
    pub const fn threshold_log_odds(&self) -> f64 {
        self.threshold_log_odds
    }

    /// True while it stands.
    #[must_use]
    pub const fn stands(&self) -> bool {
        self.stands
    }

    /// Ends the alarm.
    pub const fn reset(&mut self) {
        (self.stands, self.lull) = (false, Lull { quiet_s: 0.0 });
    }

    /// Takes the log-odds of the last `dt_s`; true if the alarm rises with them. An alarm falls
    /// only while the robot `is_excited`: at rest low log-odds show nothing.
    pub fn take(&mut self, log_odds: f64, dt_s: f64, is_excited: bool) -> bool {
        if !self.stands {
            self.stands = log_odds > self.threshold_log_odds;
            self.lull = Lull::default();
            return self.stands;
        }
        if is_excited {
            self.stands = !self.lull.take(log_odds, self.threshold_log_odds, dt_s);
        }
        false
    }
}

/// Why there is no threshold for an alarm.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum AlarmError {
    /// The model has no calibration for it.
    #[error(transparent)]
    Model(#[from] ModelError),
    /// The threshold lies above what the log-odds of a lasting fault reach: it might never rise.
    #[error(
        "at most one false alarm in {interval_h} h at fault_rate_1_h = {fault_rate_1_h} needs an \
         alarm above log-odds {alarm_log_odds:.2}, but those of the form '{form}' with this model \
         reach {reachable_log_odds:.2} at the highest: lower false_alarm_interval_h to at most \
         {interval_max_h:.4}, or take another form"
    )]
    Unreachable {
        /// Name of the form of detection.
        form: &'static str,
        /// Time between false alarms asked for, h.
        interval_h: f64,
        /// Prior fault rate asked for, 1/h.
        fault_rate_1_h: f64,
        /// The threshold that these need.
        alarm_log_odds: f64,
        /// The highest that a lasting fault keeps the log-odds at.
        reachable_log_odds: f64,
        /// The longest time between false alarms whose threshold can be reached, h.
        interval_max_h: f64,
    },
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_alarm_rises_once_and_falls_after_a_second_of_low_odds() {
        let mut alarm = Alarm::new(3.0);
        assert!(!alarm.take(3.0, 0.1, true) && !alarm.stands());
        assert!(alarm.take(3.1, 0.1, true) && alarm.stands());
        // Not low enough: below -4 is asked for, as 3 - 5 is higher.
        for _ in 0..30 {
            assert!(!alarm.take(-3.9, 0.1, true) && alarm.stands());
        }
        // Time at rest does not count, and one high value begins the second anew.
        let low = [(-5.1, true); 9].into_iter();
        let all = low.clone().chain([(-5.1, false), (0.0, true)]).chain(low);
        for (log_odds, clear) in all {
            assert!(!alarm.take(log_odds, 0.1, clear) && alarm.stands());
        }
        assert!(!alarm.take(-5.1, 0.1, true) && !alarm.stands());
        assert!(alarm.take(4.0, 0.1, true));
        alarm.reset();
        assert!(!alarm.stands());
    }

    #[test]
    fn an_alarm_with_a_low_threshold_falls_5_nats_below_it_and_bounds_are_exclusive() {
        let mut alarm = Alarm::new(-1.0);
        assert_eq!(alarm.threshold_log_odds(), -1.0);
        assert!(!alarm.take(-1.0, 1.0, true) && alarm.take(-0.9, 1.0, true));
        assert!(!alarm.take(-6.0, 10.0, true) && alarm.stands());
        assert!(!alarm.take(-6.01, 0.9, true) && alarm.stands());
        assert!(!alarm.take(-6.01, 0.1, true) && !alarm.stands());
        // The wait begins anew with each alarm.
        assert!(alarm.take(0.0, 0.1, true) && !alarm.take(-9.0, 0.9, true) && alarm.stands());
    }

    #[test]
    fn no_alarm_falls_above_log_odds_of_minus_4() {
        let mut alarm = Alarm::new(9.0);
        assert!(alarm.take(9.1, 0.1, true));
        assert!(!alarm.take(-4.0, 9.0, true) && alarm.stands());
        assert!(!alarm.take(-4.01, 1.0, true) && !alarm.stands());
    }

    #[test]
    fn log_odds_that_are_no_number_raise_no_alarm_and_keep_one() {
        let mut alarm = Alarm::new(3.0);
        assert!(!alarm.take(f64::NAN, 1.0, true) && !alarm.stands());
        assert!(alarm.take(4.0, 1.0, true));
        assert!(!alarm.take(f64::NAN, 9.0, true) && alarm.stands());
    }
}
