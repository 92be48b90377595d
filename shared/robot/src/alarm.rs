//! The alarm: at which log-odds it rises, and when it falls again.

use crate::model_file::ModelError;

/// An alarm falls when the log-odds have stayed this far below those that raise it (e^5 = 150: no
/// wander toggles it) ..
const CLEAR_BELOW: f64 = 5.0;
/// .. and below these odds (1.8 %), whatever the threshold ..
const CLEAR_LOG_ODDS: f64 = -4.0;
/// .. for this long, s: twenty 50 ms observations in a row.
const CLEAR_S: f64 = 1.0;
/// Slack when that time is compared, s: it is a sum of short intervals.
const TIME_SLACK_S: f64 = 1e-6;

/// An alarm that rises above a threshold and falls once the log-odds have been low for a second.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Alarm {
    threshold_log_odds: f64,
    stands: bool,
    quiet_s: f64,
}

impl Alarm {
    /// An alarm that does not stand, and rises above these natural log-odds.
    #[must_use]
    pub const fn new(threshold_log_odds: f64) -> Self {
        Self {
            threshold_log_odds,
            stands: false,
            quiet_s: 0.0,
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

    /// It stands no longer.
    pub const fn reset(&mut self) {
        (self.stands, self.quiet_s) = (false, 0.0);
    }

    /// Takes the log-odds that hold for the last `dt_s`; true if it rises with them. Time that does
    /// not `clear` (a robot that stands still tells nothing) lets no alarm fall.
    pub fn take(&mut self, log_odds: f64, dt_s: f64, clear: bool) -> bool {
        if !self.stands {
            (self.stands, self.quiet_s) = (log_odds > self.threshold_log_odds, 0.0);
            return self.stands;
        }
        if clear {
            let low = (self.threshold_log_odds - CLEAR_BELOW).min(CLEAR_LOG_ODDS);
            self.quiet_s = if log_odds < low {
                self.quiet_s + dt_s
            } else {
                0.0
            };
            self.stands = self.quiet_s < CLEAR_S - TIME_SLACK_S;
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
}
