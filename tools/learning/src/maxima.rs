//! Highest log-odds of successive windows of driving, from which an alarm's threshold follows.

use vigil_robot::learned::Calibration;
use vigil_robot::learned::Form;
use vigil_robot::learned::channels::Channels;

/// Length of a window, s.
pub(crate) const WINDOW_S: f64 = 2.0;

/// Maxima over windows of [`WINDOW_S`]; what is left of a run at its end counts for none.
#[derive(Debug, Clone)]
pub(crate) struct Maxima {
    found: Vec<f64>,
    in_window_s: f64,
    highest: f64,
}

impl Maxima {
    /// None yet.
    pub fn new() -> Self {
        Self {
            found: Vec::new(),
            in_window_s: 0.0,
            highest: f64::NEG_INFINITY,
        }
    }

    /// A new run begins, and a window with it.
    pub fn begin(&mut self) {
        (self.in_window_s, self.highest) = (0.0, f64::NEG_INFINITY);
    }

    /// Takes the log-odds of an observation that lasts `dt_s`.
    pub fn push(&mut self, log_odds: f64, dt_s: f64) {
        self.highest = log_odds.max(self.highest);
        self.in_window_s += dt_s;
        if self.in_window_s >= WINDOW_S {
            self.found.push(self.highest);
            self.begin();
        }
    }

    /// Time in whole windows, s.
    pub fn duration_s(&self) -> f64 {
        self.found.len() as f64 * WINDOW_S
    }

    /// Raises those of windows that say nothing to the least of all that say something.
    pub fn raise(&mut self, nothing: f64) {
        let said = self.found.iter().copied().filter(|value| *value > nothing);
        let least = said.fold(f64::INFINITY, f64::min);
        if least.is_finite() {
            self.found
                .iter_mut()
                .for_each(|value| *value = value.max(least));
        }
    }

    /// True if they are not all the same.
    pub fn vary(&self) -> bool {
        let lowest = self.found.iter().copied().fold(f64::INFINITY, f64::min);
        self.highest() > lowest
    }

    /// Highest of all; -inf if there is none.
    pub fn highest(&self) -> f64 {
        self.found.iter().copied().fold(f64::NEG_INFINITY, f64::max)
    }

    /// The tail beyond the median; see [`Calibration::fit`].
    pub fn tail(&mut self, channels: Channels, form: Form, rate_1_h: f64) -> Option<Calibration> {
        Calibration::fit(channels, form, rate_1_h, &mut self.found, WINDOW_S)
    }

    /// The tail beyond a high level; see [`Calibration::fit_high`].
    pub fn high_tail(&mut self, channels: Channels, form: Form, rate_1_h: f64) -> Calibration {
        Calibration::fit_high(channels, form, rate_1_h, &mut self.found, WINDOW_S)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_whole_window_has_one_maximum() {
        let mut maxima = Maxima::new();
        for (log_odds, dt_s) in [(1.0, 1.0), (3.0, 0.5), (2.0, 0.5), (-4.0, 2.0), (9.0, 1.9)] {
            maxima.push(log_odds, dt_s);
        }
        maxima.begin();
        maxima.push(5.0, 2.5);
        assert_eq!(maxima.found, [3.0, -4.0, 5.0]);
        assert_eq!(maxima.duration_s(), 6.0);
    }
}
