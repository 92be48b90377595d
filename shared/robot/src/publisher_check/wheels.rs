//! Wheel rates and steering angles against the command, wheel by wheel.

use vigil_blocks::{SensorFrame, WHEELS};

use super::finding::is_rate_unit;
use super::{FindingKind, RATIO_MAX, TURN_MIN_RAD, TURNING_1_M, TestOutcome};
use crate::channel_map::ChannelMap;
use crate::description::Description;
use crate::description::Kinematics;
use crate::learned::wheels::{rolling_rate, steering_angle};

/// Time in motion, s, and commanded rolling, rad, from which wheels are judged: twenty frames at
/// 20 Hz, and forty deviations of a rate's noise of 0.05 rad/s.
const TIME_MIN_S: f64 = 1.0;
const ROLLED_MIN_RAD: f64 = 2.0;
/// Ratios between this and its inverse are those of a channel with the other sign: -1, by a factor
/// of 2.5 either way for slip and gains.
const REVERSED: f64 = -0.4;
/// Squared correlation with the command above which a channel follows it: 0.77, which no noise
/// reaches over [`TIME_MIN_S`].
const FOLLOWS: f64 = 0.6;
/// Ratio of squared residuals, exchanged to as named, below which wheels are exchanged: half the
/// deviation.
const EXCHANGED: f64 = 0.25;
/// Mean commanded steering angle from which its sign is judged, rad: twenty deviations of the
/// rover's steering sensor, 3 mrad.
const STEER_MIN_RAD: f64 = 0.06;

/// Sums of a channel against what is expected of it.
#[derive(Debug, Clone, Copy, Default)]
struct RegressionSums {
    time_s: f64,
    found: f64,
    expected: f64,
    squares: f64,
}

impl RegressionSums {
    fn add(&mut self, value: f64, expected: f64, dt_s: f64) {
        self.time_s += dt_s;
        self.found += value * expected * dt_s;
        self.expected += expected * expected * dt_s;
        self.squares += value * value * dt_s;
    }

    fn ratio(&self) -> f64 {
        self.found / self.expected
    }

    fn follows(&self) -> bool {
        self.found * self.found > FOLLOWS * self.expected * self.squares
    }

    fn is_reversed(&self) -> bool {
        (1.0 / REVERSED..=REVERSED).contains(&self.ratio()) && self.follows()
    }
}

/// Two opposite wheels: squared residuals as named and exchanged, and the squared difference of
/// their expected rates.
#[derive(Debug, Clone, Copy, Default)]
struct Pair {
    wheels: [usize; 2],
    named: f64,
    exchanged: f64,
    difference: f64,
    turned_rad: f64,
}

/// All wheels of a robot.
#[derive(Debug, Clone)]
pub(super) struct Wheels {
    rates: [RegressionSums; WHEELS],
    steer: [RegressionSums; WHEELS],
    pairs: [Pair; WHEELS / 2],
    pair_count: usize,
    wheel_count: usize,
}

impl Wheels {
    /// Wheels without any measurement.
    pub fn new(robot: &Description) -> Self {
        let mut wheels = Self {
            rates: [RegressionSums::default(); WHEELS],
            steer: [RegressionSums::default(); WHEELS],
            pairs: [Pair::default(); WHEELS / 2],
            pair_count: 0,
            wheel_count: match robot.kinematics {
                // In which sense its wheels turn differs from maker to maker.
                Kinematics::Omni3 | Kinematics::None => 0,
                _ => robot.wheels.len().min(WHEELS),
            },
        };
        for (i, left) in robot.wheels.iter().enumerate().take(wheels.wheel_count) {
            let is_opposite = |other: &crate::description::Wheel| {
                (other.x - left.x).abs() < 1e-6 && (other.y + left.y).abs() < 1e-6 && left.y > 0.0
            };
            let right = robot.wheels.iter().position(is_opposite);
            if let (Some(j), Some(pair)) = (right, wheels.pairs.get_mut(wheels.pair_count)) {
                pair.wheels = [i, j];
                wheels.pair_count += 1;
            }
        }
        wheels
    }

    /// Forgets all measurements.
    pub fn reset(&mut self) {
        self.rates = [RegressionSums::default(); WHEELS];
        self.steer = [RegressionSums::default(); WHEELS];
        for pair in &mut self.pairs {
            *pair = Pair {
                wheels: pair.wheels,
                ..Pair::default()
            };
        }
    }

    /// Takes a frame of a robot in motion.
    pub fn take(
        &mut self,
        robot: &Description,
        map: &ChannelMap,
        frame: &SensorFrame,
        ([speed, _, turn], dt_s): ([f64; 3], f64),
    ) {
        let mut expected = [0.0; WHEELS];
        for (wheel, expected) in expected.iter_mut().enumerate().take(self.wheel_count) {
            *expected = match robot.kinematics {
                Kinematics::Ackermann6 => rolling_rate(robot, wheel, frame.command[0], speed),
                _ => (speed - robot.wheels[wheel].y * turn) / robot.wheel_radius_m,
            };
            if let Some(rate) = map.wheel_rate(frame, wheel) {
                self.rates[wheel].add(rate, *expected, dt_s);
            }
            if let Some(measured) = map.steer(frame, wheel) {
                let angle = steering_angle(robot, wheel, frame.command[0]);
                self.steer[wheel].add(measured, angle, dt_s);
            }
        }
        if turn.abs() < TURNING_1_M * speed.abs() {
            return;
        }
        for pair in &mut self.pairs[..self.pair_count] {
            let [i, j] = pair.wheels;
            let rates = (map.wheel_rate(frame, i), map.wheel_rate(frame, j));
            let (Some(left), Some(right)) = rates else {
                continue;
            };
            let square = |rate: f64, place: usize| (rate - expected[place]).powi(2) * dt_s;
            pair.named += square(left, i) + square(right, j);
            pair.exchanged += square(left, j) + square(right, i);
            pair.difference += (expected[i] - expected[j]).powi(2) * dt_s;
            pair.turned_rad += turn.abs() * dt_s;
        }
    }

    /// True once the wheel was commanded to roll far enough.
    fn is_judged(&self, wheel: usize) -> bool {
        let rate = &self.rates[wheel];
        let rolled_rad = (rate.expected * rate.time_s).sqrt();
        rate.time_s >= TIME_MIN_S && rolled_rad >= ROLLED_MIN_RAD
    }

    /// Tests the unit of the rates: all wheels share it.
    pub fn unit(&self) -> TestOutcome {
        let mut ratios = [0.0; WHEELS];
        let mut count = 0;
        for wheel in (0..self.wheel_count).filter(|&wheel| self.is_judged(wheel)) {
            if self.rates[wheel].follows() {
                ratios[count] = self.rates[wheel].ratio();
                count += 1;
            }
        }
        // Half of the wheels or fewer decide no unit: a fault of one must not look like it.
        if 2 * count <= self.wheel_count {
            return TestOutcome::NotYet;
        }
        let ratios = &mut ratios[..count];
        ratios.sort_unstable_by(f64::total_cmp);
        let middle = ratios[count / 2];
        match middle.abs() > RATIO_MAX || is_rate_unit(middle) {
            true => TestOutcome::new(FindingKind::Rates, None, middle),
            false => TestOutcome::Fits,
        }
    }

    /// Tests the sign of one wheel's rate.
    pub fn sign(&self, wheel: usize) -> TestOutcome {
        if wheel >= self.wheel_count || !self.is_judged(wheel) {
            return TestOutcome::NotYet;
        }
        match self.rates[wheel].is_reversed() {
            true => TestOutcome::new(
                FindingKind::RateSign,
                Some(wheel),
                self.rates[wheel].ratio(),
            ),
            false => TestOutcome::Fits,
        }
    }

    /// Tests the sign of one steering angle.
    pub fn steering(&self, wheel: usize) -> TestOutcome {
        let Some(steer) = self.steer.get(wheel) else {
            return TestOutcome::NotYet;
        };
        let is_judged = steer.time_s >= TIME_MIN_S
            && steer.expected >= STEER_MIN_RAD * STEER_MIN_RAD * steer.time_s;
        match (is_judged, steer.is_reversed()) {
            (false, _) => TestOutcome::NotYet,
            (true, true) => TestOutcome::new(FindingKind::SteerSign, Some(wheel), steer.ratio()),
            (true, false) => TestOutcome::Fits,
        }
    }

    /// Tests whether two opposite wheels are exchanged.
    pub fn sides(&self, pair: usize) -> TestOutcome {
        let Some(pair) = self.pairs[..self.pair_count].get(pair) else {
            return TestOutcome::NotYet;
        };
        if pair.turned_rad < TURN_MIN_RAD {
            return TestOutcome::NotYet;
        }
        let is_exchanged = pair.exchanged < EXCHANGED * pair.named && pair.named > pair.difference;
        match is_exchanged {
            true => TestOutcome::new(FindingKind::Sides, Some(pair.wheels[0]), 0.0),
            false => TestOutcome::Fits,
        }
    }

    /// Wheels that are tested.
    pub const fn wheel_count(&self) -> usize {
        self.wheel_count
    }

    /// The wheels of a pair, left and right.
    pub fn pair(&self, pair: usize) -> [usize; 2] {
        self.pairs.get(pair).map_or([0; 2], |pair| pair.wheels)
    }

    /// Pairs of opposite wheels.
    pub const fn pair_count(&self) -> usize {
        self.pair_count
    }
}
