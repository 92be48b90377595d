//! Drives that obey the null which the form `e-detector` declares, and some that do not.
//!
//! Only observations are simulated, no frames: the null is about what is read, so that any law can
//! be drawn exactly, at its corners too, and a thousand hours take minutes.

use rand::{RngExt, SeedableRng};
use rand_distr::{Distribution, StandardNormal, StudentT};
use rand_pcg::Pcg64Mcg;
use vigil_robot::Description;
use vigil_robot::Tolerance;
use vigil_robot::declared::{Monitor, Null, Promise, UndeclaredError};
use vigil_robot::learned::channels::Channels;
use vigil_robot::learned::wheels::{rolling_rate, steering_angle};
use vigil_robot::learned::{Model, Observation, Reading};

/// Time between observations, s, and steps of the body in it.
const DT_S: f64 = 0.05;
const FINE: u32 = 5;
/// Noise of a pose in its deviations at most, as the null says.
const NOISE_MAX: f64 = 5.0;
/// Times for which a command lasts, s.
const COMMAND_S: [f64; 2] = [1.0, 8.0];
/// One command in so many is to stand.
const STANDS: u32 = 10;
/// Healthy repeats of an encoder over the learned rate: as many as the null allows for.
const REPEATS: f64 = 3.0;
/// Observations for which a context that swings keeps its sign: 1 s, as long as a block of poses.
const SWING: u64 = 20;

/// How the context moves within its tolerance.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Context {
    /// At one edge, drawn anew with each command.
    Edge,
    /// From edge to edge once a second.
    Swings,
    /// To the edge on the side of the noise: it knows the past.
    Follows,
}

/// A law of noise and context.
#[derive(Debug, Clone, Copy)]
pub struct Law {
    /// Its name.
    pub name: &'static str,
    /// The context.
    pub context: Context,
    /// Deviation of the noise over the largest that is declared.
    pub noise: f64,
    /// Correlation of the noise over the largest magnitude that is declared.
    pub correlation: f64,
    /// Time constant of the body over the longest that is declared.
    pub lag: f64,
    /// Degrees of freedom of Student's noise of the same deviation; None: Gaussian.
    pub student: Option<f64>,
    /// Context over its tolerance.
    pub over: f64,
}

impl Law {
    const EDGE: Self = Self {
        name: "edge of the null",
        context: Context::Edge,
        noise: 1.0,
        correlation: 1.0,
        lag: 1.0,
        student: None,
        over: 1.0,
    };

    /// Corners of the null: every context, both ends of noise, correlation and lag.
    #[must_use]
    pub fn corners() -> Vec<Self> {
        let contexts = [Context::Edge, Context::Swings, Context::Follows];
        let ends = contexts.into_iter().flat_map(|context| {
            let pairs = [(1.0, 1.0), (1.0, -1.0), (1.0, 0.0), (0.4, 1.0)];
            pairs.map(|(noise, correlation)| (context, noise, correlation))
        });
        let all = ends.flat_map(|(context, noise, correlation)| {
            [1.0, 0.25].map(|lag| Self {
                name: "null",
                context,
                noise,
                correlation,
                lag,
                ..Self::EDGE
            })
        });
        all.collect()
    }

    /// Laws outside the null.
    #[must_use]
    pub fn outside() -> [Self; 5] {
        let of = |name, noise, correlation, student, over| Self {
            name,
            noise,
            correlation,
            student,
            over,
            ..Self::EDGE
        };
        [
            of("noise 1.5 times the largest", 1.5, 1.0, None, 1.0),
            of("noise twice the largest", 2.0, 1.0, None, 1.0),
            of("Student's noise, 4 degrees", 1.0, 1.0, Some(4.0), 1.0),
            of("noise correlated by 0.5", 1.0, 5.0, None, 1.0),
            of("context 1.5 times its tolerance", 1.0, 1.0, None, 1.5),
        ]
    }
}

/// The robot that is driven.
#[derive(Debug, Clone, Copy)]
pub struct Declared<'a> {
    /// Its learned model.
    pub model: &'a Model,
    /// Its description.
    pub robot: &'a Description,
    /// What is declared of its noise.
    pub null: Null,
    /// What is promised.
    pub promise: Promise,
}

impl Declared<'_> {
    /// Alarms in so many hours under a law. The detectors begin anew with each.
    ///
    /// # Errors
    /// [`UndeclaredError`].
    pub fn alarms(&self, law: Law, hours: f64, seed: u64) -> Result<u32, UndeclaredError> {
        let Self {
            model,
            robot,
            null,
            promise,
        } = *self;
        let mut monitor = Monitor::new(model, robot, Channels::PoseEncoders, null, promise)?;
        let Some(tolerance) = robot.tolerance else {
            return Ok(0);
        };
        let mut drive = Drive {
            of: *self,
            law,
            tolerance,
            student: law.student.and_then(|degrees| StudentT::new(degrees).ok()),
            rng: Pcg64Mcg::seed_from_u64(seed),
            step: 0,
            left_s: 0.0,
            command: [0.0; 2],
            signs: [1.0; 3],
            pose: [0.0; 3],
            body: [0.0; 2],
            noise: [0.0; CHANNELS],
        };
        let mut alarms = 0;
        for _ in 0..(hours * 3600.0 / DT_S) as u64 {
            monitor.step(&drive.next(), false);
            if monitor.hours() >= promise.interval_h {
                alarms += 1;
                monitor.forget_evidence();
            }
        }
        Ok(alarms)
    }
}

/// Pose, then rate and angle of each wheel.
const CHANNELS: usize = 3 + 2 * 6;

/// A drive under way.
struct Drive<'a> {
    of: Declared<'a>,
    law: Law,
    tolerance: Tolerance,
    student: Option<StudentT<f64>>,
    rng: Pcg64Mcg,
    step: u64,
    /// Time that the command still lasts, s.
    left_s: f64,
    command: [f64; 2],
    /// Where the context is: yaw, forward, lateral.
    signs: [f64; 3],
    pose: [f64; 3],
    /// Speed m/s and yaw rate rad/s that the body follows the command with.
    body: [f64; 2],
    /// Of each channel, in its largest deviations.
    noise: [f64; CHANNELS],
}

impl Drive<'_> {
    /// The next noise of a channel, in its largest deviations.
    fn noise(&mut self, channel: usize) -> f64 {
        let rho = self.law.correlation * self.of.null.correlation;
        let fresh = match &self.student {
            // Of variance 1.
            Some(student) => {
                let degrees = self.law.student.unwrap_or(4.0);
                student.sample(&mut self.rng) * ((degrees - 2.0) / degrees).sqrt()
            }
            None => StandardNormal.sample(&mut self.rng),
        };
        let noise = rho * self.noise[channel] + (1.0 - rho * rho).sqrt() * self.law.noise * fresh;
        let is_inside = self.law.noise <= 1.0 && self.student.is_none();
        self.noise[channel] = match is_inside {
            true => noise.clamp(-NOISE_MAX, NOISE_MAX),
            false => noise,
        };
        self.noise[channel]
    }

    fn decide(&mut self) {
        self.left_s -= DT_S;
        if self.left_s <= 0.0 {
            let [from, to] = COMMAND_S;
            self.left_s = self.rng.random_range(from..to);
            let [slowest, fastest] = self.of.model.command.speed_range_m_s;
            let most = self.of.model.command.curvature_max_1_m;
            self.command = match self.rng.random_range(0..STANDS) {
                0 => [0.0; 2],
                _ => [
                    self.rng.random_range(-most..most),
                    self.rng.random_range(slowest..fastest),
                ],
            };
            if self.law.context == Context::Edge {
                self.signs = self.signs.map(|_| [-1.0, 1.0][self.rng.random_range(0..2)]);
            }
        }
        match self.law.context {
            Context::Edge => {}
            Context::Swings => {
                let is_up = (self.step / SWING).is_multiple_of(2);
                self.signs = [if is_up { 1.0 } else { -1.0 }; 3];
            }
            Context::Follows => {
                let side = |noise: f64| 1.0_f64.copysign(noise);
                self.signs = [self.noise[2], self.noise[0], self.noise[1]].map(side);
            }
        }
    }

    /// Moves the body by one interval, in fine steps.
    fn move_on(&mut self) {
        let model = self.of.model;
        let [curvature, speed] = self.command;
        let limit = model.command.curvature_max_1_m;
        let [yaw, forward, lateral] = model.nominal.motion.per_metre(curvature, speed, limit);
        let lag_s = self.law.lag * model.command.lag_s * model.command.lag_uncertainty;
        let fine_s = DT_S / f64::from(FINE);
        let stays = (-fine_s / lag_s).exp();
        let Tolerance {
            yaw_rad_m,
            forward_m_m,
            lateral_m_m,
            ..
        } = self.tolerance;
        for _ in 0..FINE {
            for (body, target) in self.body.iter_mut().zip([speed, yaw * speed]) {
                *body = target + (*body - target) * stays;
            }
            let [by_yaw, by_forward, by_lateral] = self.signs.map(|sign| self.law.over * sign);
            let (travel_m, turn_rad) = (self.body[0] * fine_s, self.body[1] * fine_s);
            let chance = model.nominal.motion.white_sd.map(|sd| {
                let ratio = self.of.null.noise_ratio * self.law.noise.min(1.0);
                let fresh: f64 = StandardNormal.sample(&mut self.rng);
                ratio * sd * travel_m.abs().sqrt() * fresh
            });
            // Motors that yield shorten the turn as they do the travel.
            let yields = 1.0 + by_forward * forward_m_m;
            let turn_rad = turn_rad * yields + by_yaw * yaw_rad_m * travel_m.abs() + chance[0];
            let ahead_m = travel_m * forward * yields + chance[1];
            let across_m = travel_m * lateral + by_lateral * lateral_m_m * travel_m + chance[2];
            let (sin, cos) = (self.pose[2] + 0.5 * turn_rad).sin_cos();
            self.pose[0] += cos * ahead_m - sin * across_m;
            self.pose[1] += sin * ahead_m + cos * across_m;
            self.pose[2] += turn_rad;
        }
    }

    fn next(&mut self) -> Observation {
        self.decide();
        self.move_on();
        self.step += 1;
        let Declared {
            model, robot, null, ..
        } = self.of;
        let [curvature, speed] = self.command;
        let t_ns = self.step * (DT_S * 1e9) as u64;
        let mut observation = Observation {
            t_ns,
            t_first_ns: t_ns,
            dt_s: DT_S,
            middles_s: DT_S,
            frame_s: DT_S,
            frames: 1,
            command: self.command,
            moving: speed.abs() >= model.command.standing_m_s,
            anchor: self.step == 1,
            pose_frames: 1,
            ..Observation::default()
        };
        let variance = observation.pose_variance(model, [null.noise_ratio; 3]);
        observation.pose =
            std::array::from_fn(|axis| self.pose[axis] + variance[axis].sqrt() * self.noise(axis));
        let wheels = robot.wheels.len().min(6);
        for wheel in 0..wheels {
            let read = self.wheel(wheel, curvature, speed);
            let repeats = self.rng.random_bool(REPEATS * model.encoder.repeat_rate);
            observation.wheels[wheel] = read.0;
            if repeats {
                observation.wheels[wheel] = Reading {
                    repeats: 1,
                    ..Reading::default()
                };
            }
            observation.steer[wheel] = read.1;
        }
        observation
    }

    /// Rate and angle of a wheel.
    fn wheel(&mut self, wheel: usize, curvature: f64, speed: f64) -> (Reading, Reading) {
        let Declared {
            model, robot, null, ..
        } = self.of;
        let rolling = rolling_rate(robot, wheel, curvature, speed);
        let (rate, variance) = model.nominal.rates[wheel].rate(rolling, curvature);
        let Tolerance {
            wheel_ratio,
            wheel_rate_rad_s,
            steer_rad,
            ..
        } = self.tolerance;
        let [by_steer, by_ratio, by_wheel] = self.signs.map(|sign| self.law.over * sign);
        let largest = |sd: f64, more: f64| (null.noise_ratio * sd).hypot(more);
        let rate_sd = largest(model.noise.wheel_rate_rad_s, variance.sqrt());
        let rate = rate + by_ratio * wheel_ratio * rolling.abs() + by_wheel * wheel_rate_rad_s;
        let rate = rate + rate_sd * self.noise(3 + wheel);
        let angle = steering_angle(robot, wheel, curvature) + by_steer * steer_rad;
        let angle_sd = largest(model.noise.steer_rad, model.nominal.steer_sd_rad);
        let angle = angle + angle_sd * self.noise(9 + wheel);
        let read = |mean: f64| Reading {
            plain: 1,
            mean,
            ..Reading::default()
        };
        (read(rate), read(angle))
    }
}
