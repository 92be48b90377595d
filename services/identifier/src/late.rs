//! By how much an encoder is late: a probability for each of some delays.
//!
//! A late reading is the rate of a moment ago, which is no linear function of the delay: a grid of
//! delays stands for all. While the rate has not changed, a late encoder reads what a timely one
//! does, and nothing is said.

use vigil_blocks::WHEELS;

/// Delays, s: each a third longer than the one before, up to the longest that is looked for.
/// Shorter is within the body's lag.
pub const DELAYS: [f64; 11] = [
    0.12, 0.16, 0.21, 0.28, 0.37, 0.5, 0.66, 0.88, 1.17, 1.55, 2.0,
];
/// Observations that are kept: those of the longest delay, and some, where `interval_s` is 0.032 s
/// and more; with a shorter one the longest delays go unseen.
const KEPT: usize = 64;
/// Rates that are no further apart are alike, rad/s: one sample's noise of the rover's encoders.
const ALIKE_RAD_S: f64 = 0.05;
/// Probability with which a delay becomes any other from one observation to the next. Once in 1.4 h
/// of 50 ms: nothing is forgotten within a fault.
const CHANGES: f64 = 1e-5;
/// Prior probability of each delay.
const EVEN: f64 = 1.0 / DELAYS.len() as f64;

/// Expected rates (rad/s) of the wheels and their variances at an instant.
type Rates = [(f64, f64); WHEELS];

/// Probabilities of the delays, and the rates that the wheels had.
#[derive(Debug, Clone)]
pub struct Late {
    p: [[f64; DELAYS.len()]; WHEELS],
    past: [(u64, Rates); KEPT],
    /// Place of the last one kept, and how many there are.
    last: usize,
    count: usize,
    /// For each delay, what the wheels did so long ago.
    then: [Rates; DELAYS.len()],
}

impl Default for Late {
    fn default() -> Self {
        Self {
            p: [[EVEN; DELAYS.len()]; WHEELS],
            past: [(0, [(0.0, 0.0); WHEELS]); KEPT],
            last: 0,
            count: 0,
            then: [[(0.0, 0.0); WHEELS]; DELAYS.len()],
        }
    }
}

impl Late {
    /// Forgets everything.
    pub fn clear(&mut self) {
        self.p = [[EVEN; DELAYS.len()]; WHEELS];
        self.count = 0;
    }

    /// Keeps the rates at `t_ns`.
    pub fn keep(&mut self, t_ns: u64, rates: Rates) {
        self.last = (self.last + 1) % KEPT;
        self.past[self.last] = (t_ns, rates);
        self.count = (self.count + 1).min(KEPT);
        let (mut age, mut then) = (0, self.then);
        for (then, delay_s) in then.iter_mut().zip(DELAYS) {
            *then = self.before(t_ns, delay_s, &mut age);
        }
        self.then = then;
    }

    /// The rates `delay_s` before `t_ns`, between those kept `age` ago or longer; of what is older
    /// than all, the oldest.
    fn before(&self, t_ns: u64, delay_s: f64, age: &mut usize) -> Rates {
        let at = |age: usize| &self.past[(self.last + KEPT - age) % KEPT];
        let ago_s = |age: usize| t_ns.saturating_sub(at(age).0) as f64 * 1e-9;
        while *age + 1 < self.count && ago_s(*age + 1) < delay_s {
            *age += 1;
        }
        if *age + 1 >= self.count {
            return at(*age).1;
        }
        let ((_, new), (_, old)) = (at(*age), at(*age + 1));
        let (from_s, to_s) = (ago_s(*age), ago_s(*age + 1));
        let share = ((delay_s - from_s) / (to_s - from_s).max(1e-9)).clamp(0.0, 1.0);
        std::array::from_fn(|wheel| {
            let mix = |new: f64, old: f64| new + share * (old - new);
            let ((new, fast), (old, slow)) = (new[wheel], old[wheel]);
            (mix(new, old), mix(fast, slow))
        })
    }

    /// What a wheel's readings say for a late encoder, `reads` being their log-likelihood about a
    /// rate, variance and tail; None if it reads what a timely one does. `begun`: share of delays
    /// that began before. Learned from unless the wheel `is_stuck`.
    pub fn take(
        &mut self,
        wheel: usize,
        tail: f64,
        begun: f64,
        is_stuck: bool,
        reads: impl Fn((f64, f64, f64)) -> f64,
    ) -> Option<f64> {
        let (now, _) = self.past[self.last].1[wheel];
        let differs = |then: &Rates| (then[wheel].0 - now).abs() > ALIKE_RAD_S;
        if !self.then.iter().any(differs) {
            return None;
        }
        let p = self.p[wheel].map(|p| {
            let held = (1.0 - CHANGES) * p + CHANGES * EVEN;
            begun * held + (1.0 - begun) * EVEN
        });
        let logs = self.then.map(|then| {
            let (rate, variance) = then[wheel];
            reads((rate, variance, tail))
        });
        let largest = logs.into_iter().fold(f64::NEG_INFINITY, f64::max);
        let joint: [f64; DELAYS.len()] = std::array::from_fn(|i| p[i] * (logs[i] - largest).exp());
        let total: f64 = joint.iter().sum();
        if !(total > 0.0 && largest.is_finite()) {
            return None;
        }
        if !is_stuck {
            self.p[wheel] = joint.map(|joint| joint / total);
        }
        Some(largest + total.ln())
    }

    /// Expected delay of a wheel's encoder and its standard deviation, s.
    #[must_use]
    pub fn estimate(&self, wheel: usize) -> (f64, f64) {
        let all = || self.p[wheel].iter().zip(DELAYS);
        let mean: f64 = all().map(|(p, delay)| p * delay).sum();
        let square: f64 = all().map(|(p, delay)| p * delay * delay).sum();
        // Between two delays of the grid any is as good.
        // Of a grid whose steps are a third: sqrt 1.33 - 1 / sqrt 1.33 of a delay.
        let cell = 0.28 * mean;
        let variance = (square - mean * mean).max(0.0) + cell * cell / 12.0;
        (mean, variance.sqrt())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use vigil_inference::logspace::log_normal;

    const PERIOD_NS: u64 = 50_000_000;
    const SD: f64 = 0.05;

    /// The rate at an instant, s: a step every second.
    fn rate(t_s: f64) -> f64 {
        [1.5, 2.6, 1.9, 3.1][t_s.max(0.0) as usize % 4]
    }

    #[test]
    fn a_delay_on_the_grid_is_found_and_a_constant_rate_tells_nothing() {
        let mut late = Late::default();
        let mut sum = 0.0;
        for k in 0..120_u64 {
            let t_s = k as f64 * 0.05;
            late.keep(k * PERIOD_NS, [(rate(t_s), 1e-4); WHEELS]);
            let read = rate(t_s - 0.5);
            let said = late.take(0, 0.0, 1.0, false, |(rate, variance, _)| {
                log_normal(read - rate, variance + SD * SD)
            });
            sum += said.unwrap_or(0.0) - log_normal(read - rate(t_s), SD * SD + 1e-4);
        }
        let (delay_s, sd) = late.estimate(0);
        assert!((delay_s - 0.5).abs() < 0.02 && sd < 0.05, "{delay_s} {sd}");
        assert!(sum > 100.0);
        let mut late = Late::default();
        for k in 0..100_u64 {
            late.keep(k * PERIOD_NS, [(2.0, 1e-4); WHEELS]);
            assert_eq!(late.take(0, 0.0, 0.0, false, |_| 0.0), None);
        }
    }

    #[test]
    fn rates_between_two_instants_are_interpolated() {
        let mut late = Late::default();
        for k in 0..60_u64 {
            late.keep(k * PERIOD_NS, [(k as f64, 0.0); WHEELS]);
        }
        for (then, delay_s) in late.then.iter().zip(DELAYS) {
            assert!((then[0].0 - (59.0 - delay_s / 0.05)).abs() < 1e-6);
        }
    }
}
