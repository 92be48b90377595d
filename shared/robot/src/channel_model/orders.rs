//! Order analysis: what the channels show in step with the turns of a wheel.
//!
//! What is wrong with a wheel comes back with each of its turns: a flat tyre, a bent axle, a broken
//! tooth. Of each channel `x` and each order `h` the sum `Σ |Δθ| x e^{-ihθ}` over the wheel's angle
//! `θ`, divided by the root of `Σ Δθ²`, has the variance of `x` if the channel knows nothing of the
//! wheel. Sums beside the order, at angles that no turn repeats, tell that variance in the same
//! turns. All is a function of the angle: a wheel at rest changes nothing.

use std::f64::consts::{PI, TAU};

use nalgebra::Complex;

use super::CHANNELS_MAX;

/// Orders: times that something comes back in a turn.
pub const ORDERS: usize = 5;
/// Turns over which sums are forgotten: a few show a fault soon, more show a small one.
pub const MEMORIES_TURNS: [f64; 2] = [8.0, 32.0];
/// Part of a memory that has to be filled before it says something.
const FILLED: f64 = 0.5;
/// Angle over which the mean is forgotten that is taken off a channel, twice, rad. Chosen: a
/// change of speed is slower, the first order hardly weaker.
const MEAN_RAD: f64 = 0.7;
/// Where beside an order the noise is looked for.
const BESIDE: [f64; 4] = [-0.42, -0.3, 0.3, 0.42];
/// A reading of this magnitude or more is none: sums of it would not be finite for long.
const READING_MAX: f64 = 1e100;
/// Angle after which the phases of all orders and of what is beside them come back, rad: each of
/// [`BESIDE`] is a multiple of a fiftieth.
const PERIOD_RAD: f64 = 50.0 * TAU;

/// What the channels show in step with one wheel.
#[derive(Debug, Clone, PartialEq)]
pub struct WheelOrders {
    /// The wheel.
    pub wheel: usize,
    /// Turns over which sums are forgotten.
    pub memory_turns: f64,
    /// How far it has turned in this record, either way, turns.
    pub turns: f64,
    /// Amplitude of each channel in each order, in the channel's unit: order by order within each
    /// channel.
    pub amplitudes: Vec<Complex<f64>>,
    /// Mean square of the amplitude beside each order, likewise.
    pub beside: Vec<f64>,
}

impl WheelOrders {
    /// Nothing yet of so many channels.
    #[must_use]
    pub fn new(wheel: usize, memory_turns: f64, channels: usize) -> Self {
        Self {
            wheel,
            memory_turns,
            turns: 0.0,
            amplitudes: vec![Complex::default(); ORDERS * channels],
            beside: vec![0.0; ORDERS * channels],
        }
    }

    /// True if the wheel has turned far enough to say anything.
    #[must_use]
    pub fn is_told(&self) -> bool {
        self.turns >= FILLED * self.memory_turns
    }
}

/// Sums of one channel and order: at the order, and beside it.
#[derive(Debug, Clone, Copy, Default)]
struct Sums {
    at: Complex<f64>,
    beside: [Complex<f64>; BESIDE.len()],
}

/// Means that are taken off a channel; none before its first reading.
#[derive(Debug, Clone, Copy, Default)]
struct Means(Option<[f64; 2]>);

impl Means {
    /// What is left of a reading once the means of the last `angle_rad` are taken off.
    fn taken_off(&mut self, reading: f64, angle_rad: f64) -> f64 {
        let [mean, rest] = self.0.get_or_insert([reading, 0.0]);
        let part = 1.0 - (-angle_rad / MEAN_RAD).exp();
        let once = reading - *mean;
        *mean += part * once;
        let twice = once - *rest;
        *rest += part * twice;
        twice
    }
}

/// Follows the turns of one wheel.
#[derive(Debug, Clone)]
pub(super) struct OrderTracker {
    /// Place of the wheel's rate among the channels.
    rate: usize,
    memory_turns: f64,
    rate_rad_s: f64,
    angle_rad: f64,
    means: Vec<Means>,
    sums: Vec<Sums>,
    /// Sums of the squared steps, by order.
    squares: [f64; ORDERS],
    turns: f64,
}

impl OrderTracker {
    /// Of a wheel whose rate is at this place among so many channels.
    pub fn new(rate: usize, memory_turns: f64, channels: usize) -> Self {
        Self {
            rate,
            memory_turns,
            rate_rad_s: 0.0,
            angle_rad: 0.0,
            means: vec![Means::default(); channels],
            sums: vec![Sums::default(); ORDERS * channels],
            squares: [0.0; ORDERS],
            turns: 0.0,
        }
    }

    /// Begins a new record.
    pub fn clear(&mut self) {
        (self.rate_rad_s, self.angle_rad, self.turns) = (0.0, 0.0, 0.0);
        self.means.fill(Means::default());
        self.sums.fill(Sums::default());
        self.squares = [0.0; ORDERS];
    }

    /// Takes the readings of a frame that comes `dt_s` after the last one. A wheel whose rate is
    /// not read turns on as before.
    pub fn take(&mut self, dt_s: f64, readings: &[Option<f64>; CHANNELS_MAX]) {
        self.rate_rad_s = readings[self.rate].unwrap_or(self.rate_rad_s);
        let step_rad = self.rate_rad_s * dt_s;
        let angle_rad = step_rad.abs();
        self.angle_rad = (self.angle_rad + step_rad) % PERIOD_RAD;
        self.turns += angle_rad / TAU;
        let kept = (-angle_rad / (TAU * self.memory_turns)).exp();
        // An order that comes back within two frames is not seen.
        let seen = (0..ORDERS).filter(|h| (*h as f64 + 1.5) * angle_rad < PI);
        let seen = seen.count();
        for (h, square) in self.squares.iter_mut().enumerate() {
            let more = if h < seen { angle_rad * angle_rad } else { 0.0 };
            *square = kept * kept * *square + more;
        }
        let turn = Complex::from_polar(1.0, -self.angle_rad);
        let aside = BESIDE.map(|order| Complex::from_polar(1.0, -order * self.angle_rad));
        for (channel, means) in self.means.iter_mut().enumerate() {
            let reading = readings[channel].filter(|reading| reading.abs() < READING_MAX);
            let left = reading.map_or(0.0, |reading| means.taken_off(reading, angle_rad));
            let mut phase = turn;
            let sums = &mut self.sums[ORDERS * channel..][..ORDERS];
            for (h, sums) in sums.iter_mut().enumerate() {
                let more = if h < seen {
                    phase * (angle_rad * left)
                } else {
                    Complex::default()
                };
                sums.at = sums.at * kept + more;
                for (sum, aside) in sums.beside.iter_mut().zip(aside) {
                    *sum = *sum * kept + more * aside;
                }
                phase *= turn;
            }
        }
    }

    /// Writes what the last turns show.
    pub fn write(&self, found: &mut WheelOrders) {
        found.turns = self.turns;
        for (i, sums) in self.sums.iter().enumerate() {
            let square = self.squares[i % ORDERS];
            let per = if square > 0.0 { 1.0 / square } else { 0.0 };
            found.amplitudes[i] = sums.at * per.sqrt();
            let beside: f64 = sums.beside.iter().map(Complex::norm_sqr).sum();
            found.beside[i] = per * beside / BESIDE.len() as f64;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const DT_S: f64 = 0.02;
    const RATE_RAD_S: f64 = 8.0;

    /// A wheel's rate, and what another channel reads at each angle.
    fn turned(turns: f64, rate_rad_s: f64, dt_s: f64, reads: impl Fn(f64) -> f64) -> WheelOrders {
        let mut tracker = OrderTracker::new(0, MEMORIES_TURNS[0], 2);
        let mut angle_rad = 0.0_f64;
        while angle_rad.abs() < TAU * turns {
            angle_rad += rate_rad_s * dt_s;
            let mut readings = [None; CHANNELS_MAX];
            (readings[0], readings[1]) = (Some(rate_rad_s), Some(reads(angle_rad)));
            tracker.take(dt_s, &readings);
        }
        let mut found = WheelOrders::new(0, MEMORIES_TURNS[0], 2);
        tracker.write(&mut found);
        found
    }

    #[test]
    fn what_comes_back_three_times_a_turn_is_the_third_order() {
        let found = turned(60.0, RATE_RAD_S, DT_S, |angle| 0.5 * (3.0 * angle).cos());
        let amplitude = found.amplitudes[ORDERS + 2];
        // Of A cos(hθ) over many turns half of A is left, times the root of the number of steps
        // that are remembered: the square of a sum of powers over the sum of their squares. The
        // mean that is taken off passes (1 - z) / (1 - (1 - a) z), with z = e^{-ihΔθ}, twice.
        let step_rad = RATE_RAD_S * DT_S;
        let kept = (-step_rad / (TAU * MEMORIES_TURNS[0])).exp();
        let steps = (1.0 - kept * kept) / ((1.0 - kept) * (1.0 - kept));
        let (one, z) = (
            Complex::new(1.0, 0.0),
            Complex::from_polar(1.0, -3.0 * step_rad),
        );
        let once = (one - z) / (one - z * (-step_rad / MEAN_RAD).exp());
        let expected = once * once * 0.25 * steps.sqrt();
        assert!(
            (amplitude - expected).norm() < 0.01 * expected.norm(),
            "{amplitude} {expected}"
        );
        let others = (0..ORDERS).filter(|h| *h != 2);
        let aside = others.map(|h| found.amplitudes[ORDERS + h].norm());
        assert!(
            aside.fold(0.0, f64::max) < 0.1 * amplitude.norm(),
            "{found:?}"
        );
        assert!((found.turns - 60.0).abs() < 0.1 && found.is_told());
    }

    #[test]
    fn noise_is_as_large_at_an_order_as_beside_it() {
        use rand::{RngExt, SeedableRng};
        let (mut at, mut beside) = (0.0, 0.0);
        for seed in 0..200 {
            let rng = std::cell::RefCell::new(rand_pcg::Pcg64Mcg::seed_from_u64(seed));
            let noise = |_| rng.borrow_mut().random_range(-1.0..1.0);
            let found = turned(20.0, RATE_RAD_S, DT_S, noise);
            at += found.amplitudes[ORDERS + 2].norm_sqr() / 200.0;
            beside += found.beside[ORDERS + 2] / 200.0;
        }
        // The variance of uniform noise is 1/3; the mean that is taken off takes some of it.
        assert!((at / beside - 1.0).abs() < 0.2, "{at} {beside}");
        assert!((0.2..0.35).contains(&at), "{at}");
    }

    #[test]
    fn a_wheel_at_rest_changes_nothing_and_one_turned_back_has_the_same_orders() {
        let reads = |angle: f64| (2.0 * angle).cos();
        let mut tracker = OrderTracker::new(0, MEMORIES_TURNS[0], 1);
        let mut found = WheelOrders::new(0, MEMORIES_TURNS[0], 1);
        let mut readings = [None; CHANNELS_MAX];
        for _ in 0..500 {
            readings[0] = Some(RATE_RAD_S);
            tracker.take(DT_S, &readings);
        }
        tracker.write(&mut found);
        let before = found.clone();
        readings[0] = Some(0.0);
        for _ in 0..500 {
            tracker.take(DT_S, &readings);
        }
        tracker.write(&mut found);
        assert_eq!(found, before);
        let [forward, back] = [1.0, -1.0].map(|sign| turned(40.0, sign * RATE_RAD_S, DT_S, reads));
        let norms = [forward, back].map(|found| found.amplitudes[ORDERS + 1].norm());
        assert!((norms[0] / norms[1] - 1.0).abs() < 0.02, "{norms:?}");
    }

    #[test]
    fn an_order_that_frames_are_too_rare_for_is_not_looked_at() {
        // 1 rad a frame: the first two orders alone come back no sooner than every two frames.
        let found = turned(60.0, 1.0, 1.0, |angle| (5.0 * angle).cos());
        assert!(found.amplitudes[ORDERS + 1].norm() > 0.0);
        assert!(
            found.amplitudes[ORDERS + 2..]
                .iter()
                .all(|one| one.norm() == 0.0)
        );
    }

    #[test]
    fn no_reading_leaves_what_is_no_number() {
        for wrong in [f64::MAX, -1e200, f64::NAN, f64::INFINITY, 1e99] {
            let found = turned(20.0, RATE_RAD_S, DT_S, |angle| match angle < 30.0 {
                true => wrong,
                false => angle.sin(),
            });
            let sane = |one: &Complex<f64>| one.re.is_finite() && one.im.is_finite();
            assert!(found.amplitudes.iter().all(sane), "{wrong}");
            assert!(found.beside.iter().all(|one| one.is_finite()), "{wrong}");
        }
    }
}
