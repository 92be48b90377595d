//! Wheel rates and steering angles against the command, wheel by wheel.

use vigil_blocks::{SensorFrame, WHEELS};
use vigil_checkpoint::Checkpoint;

use super::finding::{WheelChannel, is_rate_unit};
use super::order::{Gain, Order, OrderSums};
use super::regression::RegressionSums;
use super::{FindingKind, Motion, RATIO_MAX, TURN_MIN_RAD, TURNING_1_M, TestOutcome};
use crate::channel_map::ChannelMap;
use crate::description::{Description, Kinematics, Wheel};
use crate::kinematics::contact_factors;
use crate::learned::wheels::{rolling_rate, steering_angle};

/// Time in motion, s, and commanded rolling, rad, from which wheels are judged: twenty frames at
/// 20 Hz, and forty deviations of a rate's noise of 0.05 rad/s.
const TIME_MIN_S: f64 = 1.0;
const ROLLED_MIN_RAD: f64 = 2.0;
/// Mean commanded steering angle from which its sign is judged, rad: twenty deviations of the
/// rover's steering sensor, 3 mrad.
const STEER_MIN_RAD: f64 = 0.06;
/// Ratio of the forward and the left motion, squared, from which the wheels of an omni drive are
/// told apart: below it two exchanged ones of three still follow, by [`RegressionSums::follows`].
const AXIS_MIN: f64 = 0.6;
/// A wheel that should turn at less than this share of the fastest is not asked whether it stands.
const EXPECTED_MIN: f64 = 0.3;
/// Commanded turn after which an order that no curve has shown is in doubt: a full turn.
const TURN_ENOUGH_RAD: f64 = std::f64::consts::TAU;
/// Places of all wheels.
const PLACES: [usize; WHEELS] = [0, 1, 2, 3, 4, 5, 6, 7];

/// All wheels of a robot.
#[derive(Debug, Clone, Checkpoint)]
pub(super) struct Wheels {
    #[checkpoint(fixed)]
    kinematics: Kinematics,
    x_m: [f64; WHEELS],
    y_m: [f64; WHEELS],
    wheel_count: usize,
    /// Places of the steered wheels.
    steered: [usize; WHEELS],
    steered_count: usize,
    /// Rates where both sides roll much alike.
    straight: [RegressionSums; WHEELS],
    steer: [RegressionSums; WHEELS],
    /// Squared way forward and to the left, m²/s.
    way: [f64; 2],
    turned_rad: f64,
    rate_sums: OrderSums,
    steer_sums: OrderSums,
    /// Orders at the last evaluation.
    rate_order: Option<Order>,
    steer_order: Option<Order>,
}

impl Wheels {
    /// Wheels without any measurement.
    pub fn new(robot: &Description) -> Self {
        let has_rates = robot.kinematics != Kinematics::None;
        let wheel_count = usize::from(has_rates) * robot.wheels.len().min(WHEELS);
        let wheels = &robot.wheels[..wheel_count];
        let place =
            |of: fn(&Wheel) -> f64| std::array::from_fn(|wheel| wheels.get(wheel).map_or(0.0, of));
        let (mut steered, mut steered_count) = ([0; WHEELS], 0);
        for (wheel, _) in wheels.iter().enumerate().filter(|(_, at)| at.steered) {
            steered[steered_count] = wheel;
            steered_count += 1;
        }
        Self {
            kinematics: robot.kinematics,
            x_m: place(|wheel| wheel.x),
            y_m: place(|wheel| wheel.y),
            wheel_count,
            steered,
            steered_count,
            straight: [RegressionSums::default(); WHEELS],
            steer: [RegressionSums::default(); WHEELS],
            way: [0.0; 2],
            turned_rad: 0.0,
            rate_sums: OrderSums::default(),
            steer_sums: OrderSums::default(),
            rate_order: None,
            steer_order: None,
        }
    }

    /// Forgets all measurements.
    pub fn reset(&mut self, robot: &Description) {
        *self = Self::new(robot);
    }

    /// Takes a frame of a robot in motion; true if a wheel stands that should turn.
    pub fn take(
        &mut self,
        robot: &Description,
        map: &ChannelMap,
        frame: &SensorFrame,
        motion: Motion,
    ) -> bool {
        let [speed, left, turn] = motion.twist;
        let dt_s = motion.dt_s;
        let reach_m = self.y_m.iter().fold(0.0_f64, |most, y| most.max(y.abs()));
        let is_omni = self.kinematics == Kinematics::Omni3;
        let is_straight = is_omni || speed.abs() >= 2.0 * reach_m * turn.abs();
        let mut found = [(0.0, false); WHEELS];
        let (mut expected, mut angles) = ([0.0; WHEELS], [0.0; WHEELS]);
        let mut steers = found;
        for wheel in 0..self.wheel_count {
            expected[wheel] = expected_rate(robot, wheel, &frame.command);
            angles[wheel] = steering_angle(robot, wheel, frame.command[0]);
            if let Some(rate) = map.wheel_rate(frame, wheel).filter(|v| v.is_finite()) {
                found[wheel] = (rate, true);
                if is_straight {
                    self.straight[wheel].add(rate, expected[wheel], dt_s);
                }
            }
            if let Some(angle) = map.steer(frame, wheel).filter(|v| v.is_finite()) {
                steers[wheel] = (angle, true);
                self.steer[wheel].add(angle, angles[wheel], dt_s);
            }
        }
        (self.way[0], self.way[1]) = (
            self.way[0] + speed * speed * dt_s,
            self.way[1] + left * left * dt_s,
        );
        let wheels = &PLACES[..self.wheel_count];
        let has_standing = has_standing(wheels.iter().map(|&at| (found[at], expected[at])));
        if !is_omni && turn.abs() < TURNING_1_M * speed.abs() {
            return has_standing;
        }
        self.turned_rad += turn.abs() * dt_s;
        if wheels.iter().all(|&wheel| found[wheel].1) {
            let values = found.map(|(value, _)| value);
            self.rate_sums.add(wheels, &values, &expected, dt_s);
        }
        let steered = &self.steered[..self.steered_count];
        if steered.iter().all(|&wheel| steers[wheel].1) {
            let values = steers.map(|(value, _)| value);
            self.steer_sums.add(steered, &values, &angles, dt_s);
        }
        has_standing
    }

    /// Finds the orders that fit best, for the tests that follow.
    pub fn settle(&mut self) {
        let is_shown = match self.kinematics {
            Kinematics::Omni3 => self.has_both_axes(),
            _ => self.turned_rad >= TURN_MIN_RAD,
        };
        if !is_shown {
            return;
        }
        let wheels = &PLACES[..self.wheel_count];
        if self.rate_sums.time_s > 0.0 {
            let order = |factors| {
                let gain = Gain::Known(factors);
                self.rate_sums.best(wheels, &self.x_m, gain)
            };
            let factors = self.factors();
            let order = match self.kinematics {
                Kinematics::Omni3 => {
                    // In which sense its wheels turn differs from maker to maker.
                    let both = [factors, factors.map(|factor| -factor)].map(order);
                    let [one, other] = both;
                    match one.residual(wheels) <= other.residual(wheels) {
                        true => one,
                        false => other,
                    }
                }
                _ => order(factors),
            };
            self.rate_order = Some(order);
        }
        if self.steer_sums.time_s > 0.0 {
            let steered = &self.steered[..self.steered_count];
            self.steer_order = Some(self.steer_sums.best(steered, &self.x_m, Gain::EitherSign));
        }
    }

    /// What makes of each rate one in rad/s with the sign of the command.
    fn factors(&self) -> [f64; WHEELS] {
        let is_scaled = self.kinematics == Kinematics::Omni3 || self.has_other_unit();
        let size = match is_scaled {
            true => self.rate_sums.size(&PLACES[..self.wheel_count]),
            false => 1.0,
        };
        let (factor, sense) = (1.0 / size.max(f64::MIN_POSITIVE), self.sense());
        std::array::from_fn(|wheel| {
            let straight = &self.straight[wheel];
            match is_rolled(straight) && straight.is_reversed(sense) {
                true => -factor,
                false => factor,
            }
        })
    }

    /// Middle of the wheels' ratios of rate to command; none where half of the wheels or more do
    /// not follow: a fault of one must not look like a unit.
    fn middle(&self) -> Option<f64> {
        let mut ratios = [0.0; WHEELS];
        let mut count = 0;
        for rate in &self.straight[..self.wheel_count] {
            if is_rolled(rate) && rate.follows() {
                ratios[count] = rate.ratio();
                count += 1;
            }
        }
        if 2 * count <= self.wheel_count {
            return None;
        }
        let ratios = &mut ratios[..count];
        ratios.sort_unstable_by(f64::total_cmp);
        Some(ratios[count / 2])
    }

    fn has_other_unit(&self) -> bool {
        let is_other = |middle: f64| middle.abs() > RATIO_MAX || is_rate_unit(middle.abs());
        self.middle().is_some_and(is_other)
    }

    /// Tests the unit of the rates: all wheels share it.
    pub fn unit(&self) -> TestOutcome {
        let rolled = self.straight[..self.wheel_count].iter();
        let rolled = rolled.filter(|rate| is_rolled(rate)).count();
        match self.middle() {
            None if 2 * rolled <= self.wheel_count => TestOutcome::NotYet,
            None => TestOutcome::Unclear,
            Some(middle) if self.has_other_unit() => {
                TestOutcome::new(FindingKind::Rates, None, middle)
            }
            Some(middle) if middle.abs() < 1.0 / RATIO_MAX => TestOutcome::Unclear,
            Some(_) => TestOutcome::Fits,
        }
    }

    /// Tests the sign of one wheel's rate.
    pub fn sign(&self, wheel: usize) -> TestOutcome {
        let is_shown = self.kinematics != Kinematics::Omni3 || self.has_both_axes();
        if wheel >= self.wheel_count || !is_shown || !is_rolled(&self.straight[wheel]) {
            return TestOutcome::NotYet;
        }
        let (straight, sense) = (&self.straight[wheel], self.sense());
        if straight.is_reversed(sense) {
            return TestOutcome::new(FindingKind::RateSign, Some(wheel), straight.ratio());
        }
        match straight.follows() && sense * straight.ratio() > 0.0 {
            true => TestOutcome::Fits,
            false => TestOutcome::Unclear,
        }
    }

    /// 1, or -1 where most wheels of an omni drive turn in the other sense; 0 if no more than half
    /// agree.
    fn sense(&self) -> f64 {
        if self.kinematics != Kinematics::Omni3 {
            return 1.0;
        }
        self.middle().map_or(0.0, f64::signum)
    }

    fn has_both_axes(&self) -> bool {
        let [forward, left] = self.way;
        forward.min(left) >= AXIS_MIN * forward.max(left) && forward.min(left) > 0.0
    }

    /// Tests the sign of one steering angle.
    pub fn steering(&self, wheel: usize) -> TestOutcome {
        let Some(steer) = self.steer.get(wheel) else {
            return TestOutcome::NotYet;
        };
        let least = STEER_MIN_RAD * STEER_MIN_RAD * steer.time_s;
        if steer.time_s < TIME_MIN_S || steer.expected < least {
            return TestOutcome::NotYet;
        }
        if steer.is_reversed(1.0) {
            return TestOutcome::new(FindingKind::SteerSign, Some(wheel), steer.ratio());
        }
        match steer.follows() && (1.0 / RATIO_MAX..RATIO_MAX).contains(&steer.ratio()) {
            true => TestOutcome::Fits,
            false => TestOutcome::Unclear,
        }
    }

    /// Tests whether a channel reads the wheel of its name and not another of `group`.
    pub fn order(&self, channel: WheelChannel, wheel: usize, group: Group) -> TestOutcome {
        let order = match channel {
            WheelChannel::Rate => &self.rate_order,
            WheelChannel::Steer => &self.steer_order,
        };
        let Some(order) = order else {
            return TestOutcome::NotYet;
        };
        if let Some(other) = order.other_wheel(wheel) {
            return match (self.is_in(group, wheel, other), order.is_exchange(wheel)) {
                (false, _) => TestOutcome::NotYet,
                // Told of the first of both.
                (true, true) if other < wheel => TestOutcome::Told,
                (true, is_exchange) => {
                    let kind = FindingKind::order(channel, is_exchange);
                    TestOutcome::new(kind, Some(wheel), other as f64)
                }
            };
        }
        let mut others = self.others(group, wheel);
        match others.all(|other| order.tells_apart(wheel, other)) {
            true => TestOutcome::Fits,
            false if self.turned_rad > TURN_ENOUGH_RAD && group != Group::Side => {
                TestOutcome::Unclear
            }
            false => TestOutcome::NotYet,
        }
    }

    /// Wheels of a group.
    pub fn others(&self, group: Group, wheel: usize) -> impl Iterator<Item = usize> {
        let all = 0..self.wheel_count;
        all.filter(move |&other| other != wheel && self.is_in(group, wheel, other))
    }

    fn is_in(&self, group: Group, wheel: usize, other: usize) -> bool {
        let differs = |a: f64, b: f64| (a - b).abs() > 1e-6;
        let is_aside = differs(self.y_m[wheel], self.y_m[other]);
        let is_elsewhere = differs(self.x_m[wheel].abs(), self.x_m[other].abs());
        let is_omni = self.kinematics == Kinematics::Omni3;
        let has_curves = self.kinematics == Kinematics::Ackermann6;
        match group {
            Group::Across => is_aside || is_omni,
            Group::Side => !is_aside && is_elsewhere && has_curves,
            Group::Alike => !(is_aside || is_omni || is_elsewhere && has_curves),
            Group::Steered => {
                let steered = &self.steered[..self.steered_count];
                (is_aside || is_elsewhere) && steered.contains(&other)
            }
        }
    }

    /// Wheels that are tested.
    pub const fn wheel_count(&self) -> usize {
        self.wheel_count
    }
}

/// Wheels that a wheel's channel is told from, by what shows the difference.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Group {
    /// On the other side: any curve.
    Across,
    /// On the same side, nearer to the middle or further from it: tight curves.
    Side,
    /// That read the same in every motion.
    Alike,
    /// Steered by another angle.
    Steered,
}

/// True if a wheel hardly turns that should, and others turn as they are told: it may turn the body
/// in any way. Of each wheel its rate, whether that was measured, and the rate it should have.
fn has_standing(wheels: impl Iterator<Item = ((f64, bool), f64)> + Clone) -> bool {
    let fastest = |most: f64, (_, expected): (_, f64)| most.max(expected.abs());
    let least = EXPECTED_MIN * wheels.clone().fold(0.0, fastest);
    let [mut standing, mut turning] = [false; 2];
    for ((rate, is_measured), expected) in wheels {
        if !is_measured || expected.abs() <= least {
            continue;
        }
        match (rate / expected).abs() {
            // These are other wheels' rates, or of another unit.
            ratio if ratio > RATIO_MAX => return false,
            ratio if ratio * RATIO_MAX < 1.0 => standing = true,
            _ => turning = true,
        }
    }
    standing && turning
}

fn is_rolled(rate: &RegressionSums) -> bool {
    let rolled_rad = (rate.expected * rate.time_s).sqrt();
    rate.time_s >= TIME_MIN_S && rolled_rad >= ROLLED_MIN_RAD
}

/// Rate (rad/s) that rolling without slip demands of a wheel at a command. An omni drive's wheels
/// may all turn in the other sense.
#[must_use]
pub fn expected_rate(robot: &Description, wheel: usize, command: &[f64]) -> f64 {
    let twist = robot.twist(command);
    match (robot.kinematics, contact_factors(robot, wheel)) {
        (Kinematics::Ackermann6, _) => rolling_rate(robot, wheel, command[0], twist[0]),
        (_, Some(factors)) => {
            let parts = factors
                .iter()
                .zip(twist)
                .map(|(factor, value)| factor * value);
            parts.sum::<f64>() / robot.wheel_radius_m
        }
        (_, None) => 0.0,
    }
}
