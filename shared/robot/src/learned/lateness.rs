//! Odds that an encoder is late, for the detector: it reads what its wheel did a moment ago.
//!
//! Such a fault shows only while the rate changes, and is no constant bias: what one change says
//! for it must last until the next. Each delay of a grid is a fault of its own with the odds
//! `(odds + birth) x likelihood ratio` (Shiryaev), where a reading shows it.

use vigil_blocks::WHEELS;
use vigil_checkpoint::CheckpointValue;
use vigil_inference::ages::LOG_ODDS_MAX;
use vigil_inference::logspace::{log_add, log_normal, log_sum_exp};
use vigil_inference::outlier::SPREAD;

use super::past_rates::{DELAYS_S, PastRates, Rates};

/// A wheel's reading beside what a timely encoder reads.
#[derive(Debug, Clone, Copy)]
pub(super) struct Timely {
    /// Mean rate that was read, rad/s.
    pub read_rad_s: f64,
    /// How far it is from what is expected now, rad/s, and its variance in all, (rad/s)².
    pub residual_rad_s: f64,
    pub variance: f64,
    /// Variance of the reading about the wheel's rate, (rad/s)².
    pub noise: f64,
    /// Probability that it is an outlier.
    pub outlier_rate: f64,
}

impl Timely {
    /// Log-density of a reading so far from what is expected. An outlier is as far out as it is
    /// for a timely encoder, whatever explains the rest.
    fn log_density(&self, apart: f64, variance: f64) -> f64 {
        let far = log_normal(apart, SPREAD * SPREAD * self.variance);
        log_add(
            (-self.outlier_rate).ln_1p() + log_normal(apart, variance),
            self.outlier_rate.ln() + far,
        )
    }
}

/// Log-odds that a wheel's encoder is late, by each delay and in all, and what the last reading
/// said for that, if a delay would have shown.
#[derive(Debug, Clone, Copy, CheckpointValue)]
struct Odds {
    delays: [f64; DELAYS_S.len()],
    all: f64,
    gain: Option<f64>,
}

const NONE: Odds = Odds {
    delays: [f64::NEG_INFINITY; DELAYS_S.len()],
    all: f64::NEG_INFINITY,
    gain: None,
};

/// Of all encoders.
#[derive(Debug, Clone, CheckpointValue)]
pub(super) struct Lateness {
    past: PastRates,
    wheels: [Odds; WHEELS],
}

impl Default for Lateness {
    fn default() -> Self {
        Self {
            past: PastRates::default(),
            wheels: [NONE; WHEELS],
        }
    }
}

impl Lateness {
    /// Forgets what speaks for a fault, and keeps the rates.
    pub const fn forget(&mut self) {
        self.wheels = [NONE; WHEELS];
    }

    /// Log-odds that a wheel's encoder is late, and what the last observation said for that; None
    /// where a delay would not have shown.
    pub const fn odds(&self, wheel: usize) -> (f64, Option<f64>) {
        (self.wheels[wheel].all, self.wheels[wheel].gain)
    }

    /// The wheels stand at `t_ns`.
    pub fn rest(&mut self, t_ns: u64) {
        self.past.keep(t_ns, [(0.0, 0.0); WHEELS]);
        self.wheels.iter_mut().for_each(|odds| odds.gain = None);
    }

    /// Takes readings of wheels that turn at `rates` at `t_ns`; `birth` is the
    /// probability that an encoder has become late since the last ones. A delay at which the rate
    /// was the same gains nothing.
    pub fn step(
        &mut self,
        t_ns: u64,
        rates: Rates,
        readings: &[Option<Timely>; WHEELS],
        birth: f64,
    ) {
        self.past.keep(t_ns, rates);
        let born = birth.ln() - (DELAYS_S.len() as f64).ln();
        for (wheel, reading) in readings.iter().enumerate() {
            self.wheels[wheel].gain = None;
            if let Some(reading) = reading {
                self.wheels[wheel].step(wheel, reading, &self.past, born);
            }
        }
    }
}

impl Odds {
    fn step(&mut self, wheel: usize, reading: &Timely, past: &PastRates, born: f64) {
        let then = past.then(wheel);
        let shows = then.map(|then| past.differs(wheel, then.0));
        if !shows.contains(&true) {
            return;
        }
        let timely = reading.log_density(reading.residual_rad_s, reading.variance);
        let mut before = self.delays;
        for (i, (rate, variance)) in then.into_iter().enumerate().filter(|(i, _)| shows[*i]) {
            before[i] = log_add(before[i], born);
            let late = reading.log_density(reading.read_rad_s - rate, variance + reading.noise);
            let said = late - timely;
            self.delays[i] = before[i] + if said.is_finite() { said } else { 0.0 };
        }
        self.all = log_sum_exp(&self.delays);
        self.gain = Some(self.all - log_sum_exp(&before));
        let excess = (self.all - LOG_ODDS_MAX).max(0.0);
        self.delays.iter_mut().for_each(|odds| *odds -= excess);
        self.all -= excess;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const PERIOD_NS: u64 = 50_000_000;
    const NOISE: f64 = 0.0025;
    const WIDTH: f64 = 1e-4;

    fn reading(read: f64, expected: f64) -> Timely {
        Timely {
            read_rad_s: read,
            residual_rad_s: read - expected,
            variance: NOISE + WIDTH,
            noise: NOISE,
            outlier_rate: 1e-5,
        }
    }

    /// Log-odds after 20 s of rates that change every two seconds, read so late.
    fn after(delay_s: f64) -> f64 {
        let rate = |t_s: f64| [1.5, 2.6, 1.9, 3.1][(0.5 * t_s.max(0.0)) as usize % 4];
        let mut late = Lateness::default();
        for k in 1..400_u64 {
            let t_s = k as f64 * 0.05;
            // Deterministic noise of about one deviation.
            let noise = 0.05 * (17.0 * t_s).sin();
            let mut readings = [None; WHEELS];
            readings[2] = Some(reading(rate(t_s - delay_s) + noise, rate(t_s)));
            late.step(k * PERIOD_NS, [(rate(t_s), WIDTH); WHEELS], &readings, 1e-6);
        }
        assert!(late.odds(0).0 == f64::NEG_INFINITY);
        late.odds(2).0
    }

    #[test]
    fn a_late_encoder_is_seen_whether_its_delay_is_on_the_grid_or_not() {
        for delay_s in [0.28, 0.6, 1.0, 1.55] {
            let late = after(delay_s);
            assert!(late > 30.0, "{delay_s}: {late}");
        }
        let timely = after(0.0);
        assert!(timely < -10.0, "{timely}");
    }

    #[test]
    fn what_a_change_said_lasts_while_the_rate_is_constant() {
        let mut late = Lateness::default();
        let mut at = |k: u64, read: f64, rate: f64| {
            let mut readings = [None; WHEELS];
            readings[0] = Some(reading(read, rate));
            late.step(k * PERIOD_NS, [(rate, WIDTH); WHEELS], &readings, 1e-6);
            late.odds(0)
        };
        // It turns faster, and reads so 0.5 s later.
        for (from, to, read, rate) in [(0, 50, 1.5, 1.5), (50, 60, 1.5, 2.5), (60, 120, 2.5, 2.5)] {
            (from..to).for_each(|k| {
                at(k, read, rate);
            });
        }
        let (odds, _) = at(120, 2.5, 2.5);
        assert!(odds > 20.0, "{odds}");
        for k in 121..2000 {
            assert_eq!(at(k, 2.5, 2.5), (odds, None));
        }
    }

    #[test]
    fn at_its_bound_each_change_still_speaks_for_it() {
        let mut late = Lateness::default();
        let (mut gained, mut most) = (0.0, 0.0_f64);
        for k in 1..12_000_u64 {
            let rate = |k: u64| [1.5, 2.5, 2.0][(k / 60 % 3) as usize];
            let mut readings = [None; WHEELS];
            readings[0] = Some(reading(rate(k.saturating_sub(10)), rate(k)));
            late.step(k * PERIOD_NS, [(rate(k), WIDTH); WHEELS], &readings, 1e-6);
            most = most.max(late.odds(0).0);
            if k > 6_000 {
                gained += late.odds(0).1.unwrap_or_default();
            }
        }
        // 100 changes, each of which shows in ten readings.
        assert!(gained > 1e3, "{gained}");
        assert!(most <= LOG_ODDS_MAX);
    }

    #[test]
    fn one_reading_is_the_likelihood_ratio() {
        let mut late = Lateness::default();
        late.step(0, [(2.0, WIDTH); WHEELS], &[None; WHEELS], 1e-6);
        let mut readings = [None; WHEELS];
        readings[0] = Some(Timely {
            outlier_rate: 0.0,
            ..reading(2.9, 3.0)
        });
        late.step(5_000_000_000, [(3.0, WIDTH); WHEELS], &readings, 1e-6);
        // All delays lie between the two instants: the rate then was interpolated.
        let rates = DELAYS_S.map(|delay_s| 3.0 - delay_s / 5.0);
        let ratio = |rate: f64| {
            let [late, timely] = [rate, 3.0].map(|rate| log_normal(2.9 - rate, NOISE + WIDTH));
            1e-6 / DELAYS_S.len() as f64 * (late - timely).exp()
        };
        let shown = rates.into_iter().filter(|rate| 3.0 - rate > 0.05);
        let expected: f64 = shown.map(ratio).sum();
        assert!((late.odds(0).0 - expected.ln()).abs() < 1e-9);
    }
}
