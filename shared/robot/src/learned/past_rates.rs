//! The rates that the wheels had some moments ago: what an encoder that is late reads.
//!
//! A late reading is the rate of a moment ago, which is no linear function of the delay: a grid of
//! delays stands for all. While the rate has not changed, a late encoder reads what a timely one
//! does, and nothing is said.

use vigil_blocks::WHEELS;
use vigil_checkpoint::CheckpointValue;

/// Delays, s: each a third longer than the one before, up to the longest that is looked for.
/// Shorter is within the body's lag.
pub const DELAYS_S: [f64; 11] = [
    0.12, 0.16, 0.21, 0.28, 0.37, 0.5, 0.66, 0.88, 1.17, 1.55, 2.0,
];
/// Observations that are kept: those of the longest delay, and some, where `interval_s` is 0.032 s
/// and more; with a shorter one the longest delays go unseen.
const KEPT: usize = 64;
/// Rates that are no further apart are alike, rad/s: one sample's noise of the rover's encoders.
const ALIKE_RAD_S: f64 = 0.05;

/// Expected rates (rad/s) of the wheels and their variances at an instant.
pub type Rates = [(f64, f64); WHEELS];

/// The rates of the last seconds.
#[derive(Debug, Clone, CheckpointValue)]
pub struct PastRates {
    past: [(u64, Rates); KEPT],
    /// Place of the last one kept, and how many there are.
    last: usize,
    count: usize,
    /// For each delay, what the wheels did so long ago.
    then: [Rates; DELAYS_S.len()],
}

impl Default for PastRates {
    fn default() -> Self {
        Self {
            past: [(0, [(0.0, 0.0); WHEELS]); KEPT],
            last: 0,
            count: 0,
            then: [[(0.0, 0.0); WHEELS]; DELAYS_S.len()],
        }
    }
}

impl PastRates {
    /// Forgets everything.
    pub const fn clear(&mut self) {
        self.count = 0;
    }

    /// Keeps the rates at `t_ns`; where the clock was set back, forgets those before.
    pub fn keep(&mut self, t_ns: u64, rates: Rates) {
        if t_ns < self.past[self.last].0 {
            self.clear();
        }
        self.last = (self.last + 1) % KEPT;
        self.past[self.last] = (t_ns, rates);
        self.count = (self.count + 1).min(KEPT);
        let (mut age, mut then) = (0, self.then);
        for (then, delay_s) in then.iter_mut().zip(DELAYS_S) {
            *then = self.before(t_ns, delay_s, &mut age);
        }
        self.then = then;
    }

    /// A wheel's rate and its variance, each of [`DELAYS_S`] ago.
    #[must_use]
    pub fn then(&self, wheel: usize) -> [(f64, f64); DELAYS_S.len()] {
        self.then.map(|then| then[wheel])
    }

    /// True if this rate, rad/s, is another than the wheel's rate now.
    #[must_use]
    pub fn differs(&self, wheel: usize, rate_rad_s: f64) -> bool {
        (rate_rad_s - self.past[self.last].1[wheel].0).abs() > ALIKE_RAD_S
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
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rates_between_two_instants_are_interpolated() {
        let mut rates = PastRates::default();
        for k in 0..200_u64 {
            rates.keep(k * 50_000_000, [(k as f64, 0.0); WHEELS]);
        }
        for (then, delay_s) in rates.then(0).into_iter().zip(DELAYS_S) {
            assert!((then.0 - (199.0 - delay_s / 0.05)).abs() < 1e-6);
            assert!(rates.differs(0, then.0));
        }
        rates.keep(1, [(7.0, 0.0); WHEELS]);
        assert!(rates.then(0).iter().all(|then| *then == (7.0, 0.0)));
    }
}
