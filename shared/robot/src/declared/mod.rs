//! The rover against a declared null: false alarms that are rare by proof
//! ([`vigil_inference::e_detector`]).
//!
//! Nothing is learned on the way. What a healthy rover may do is declared: by the learned model
//! (the prediction, the noise of each sensor), by its description (the tolerances, the lag of the
//! body) and by [`Null`]. Under *every* law and trajectory within these bounds, whatever is driven
//! and whoever steers by the readings, the mean time between false alarms is what was asked for, or
//! longer. Precisely, for each observation in motion:
//!
//! | channel | prediction | context, at most | noise |
//! |---|---|---|---|
//! | heading | `v dt f_yaw(κ)` | `yaw_rad_m v dt` + `forward_m_m` of the turn + lag | position |
//! | travel ahead | `v dt f(κ)` | `forward_m_m v dt` + lag | position |
//! | travel across | `v dt f(κ)` | `lateral_m_m v dt` + lag | position |
//! | wheel rate | the model's | `wheel_ratio` of rolling + `wheel_rate_rad_s` + lag | level |
//! | steering angle | Ackermann's | `steer_rad` + lag | level |
//! | exact repeats of an encoder | | `REPEATS` times the learned rate | |
//!
//! with commanded curvature κ and speed v. Travel turns with the heading, which is wrong by its own
//! bounds: that widens what is allowed of it. A level's context may jump anywhere within its bound
//! from one observation to the next: no rate is asked for. Noise is sub-Gaussian, with a deviation
//! of up to [`Null::noise_ratio`] times the learned one, and a correlation from one observation to
//! the next of magnitude [`Null::correlation`] at most; that of a pose is never larger than five of
//! these deviations, nor is what chance turns the robot within a block. What is lost on the way,
//! and when frames come, depends on nothing of that. Between two observations the command goes
//! from one to the other without overshooting.
//!
//! **Lag.** A body that follows the command with any time constant up to `τ = lag_s ·
//! lag_uncertainty` is apart from it by `D` at most, `D' = |command'| - D / τ`: each change of the
//! command fades, and the slowest fades last. `D` widens the context, so that little is said while
//! the command changes. What the learned motion adds to the command changes with it by little; that
//! it lags too is left to the tolerances.
//!
//! **Who steers by the readings.** A robot that stops breaks off the blocks of poses under way,
//! which costs all that they have; a missing pose costs nothing
//! ([`vigil_inference::e_detector::path`]).
//! For the same reason a block vouches for an alarm only at its end: until one stands, the log-odds
//! rise and fall with the blocks, while those of each channel hold what the last block has shown.
//!
//! Silent and frozen sensors and a robot that moves unbidden ([`Troubles`]) are no part of the
//! null: they alarm at once, as with every form of detection. Gyro and currents have no declared
//! null yet and say nothing here.

mod lag_bounds;
mod pose;

use vigil_blocks::WHEELS;
use vigil_checkpoint::{Checkpoint, CheckpointValue};
use vigil_inference::e_detector::level::{Level, LevelReading};
use vigil_inference::e_detector::{EDetector, repeats};

use crate::description::Description;
use crate::learned::channels::Channels;
use crate::learned::monitor::DetectionOutput;
use crate::learned::wheels::{rolling_rate, steering_angle};
use crate::learned::{Model, Observation, Troubles};
use crate::robot_model::RobotModel;
use crate::slot::{SLOTS, Slot};
use crate::tolerance::Tolerance;
use lag_bounds::LagBounds;
use pose::{PoseBlocks, PoseStep};

/// Shares of the groups: how a fault first shows. Chosen, as those of the calibrated form: one
/// counts by its logarithm only.
const SHARE_POSE: f64 = 0.5;
const SHARE_WHEELS: f64 = 0.35;
const SHARE_REPEATS: f64 = 0.1;
const SHARE_STEER: f64 = 0.05;
/// Largest rate of exact repeats in health, over the learned one. Chosen: it costs ln 3 of the 7
/// nats that a repeat says.
const REPEATS: f64 = 3.0;
/// Log-odds of a channel that is silent, or moves when it should stand: every alarm rises.
const TROUBLE_LOG_ODDS: f64 = 40.0;
/// Log-odds below this are reported as this: no evidence for a fault at all.
const LOG_ODDS_MIN: f64 = -700.0;

/// What is declared of the noise, beside the learned model.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Null {
    /// Largest deviation of a sensor's noise over the learned one, at least 1.
    pub noise_ratio: f64,
    /// Largest magnitude of the correlation of the noise of successive observations, below 1.
    pub correlation: f64,
}

/// What is promised, and in which unit it is told.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Promise {
    /// Mean time between false alarms at least, h.
    pub interval_h: f64,
    /// Prior rate of faults, 1/h. It turns time into odds, and no alarm depends on it.
    pub fault_rate_1_h: f64,
}

impl Promise {
    /// Log-odds at which the alarm rises: those of M = `interval_h`. Even or higher, as at least
    /// one fault in that time counts as expected.
    #[must_use]
    pub fn alarm_log_odds(&self) -> f64 {
        self.log_odds(self.interval_h)
    }

    /// Natural log-odds of a fault at a sum M of so many hours: the Shiryaev-Roberts sum over all
    /// onsets is the odds of a rare fault over its prior rate.
    fn log_odds(&self, hours: f64) -> f64 {
        let rate_1_h = self.fault_rate_1_h.max(1.0 / self.interval_h);
        (hours * rate_1_h).ln().max(LOG_ODDS_MIN)
    }
}

/// Why a robot has no declared null.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum UndeclaredError {
    /// Its description has no tolerances.
    #[error(
        "the form 'e-detector' needs declared tolerances, and {robot} has none: add [tolerance] to \
         its description, or take another form"
    )]
    Tolerance {
        /// Name of the robot.
        robot: String,
    },
    /// Its model knows channels only, of which none has a declared tolerance.
    #[error(
        "the form 'e-detector' needs a model with a motion and wheels, and that of {robot} has \
         channels alone, whose tolerances nobody has declared: take another form"
    )]
    Model {
        /// Name of the robot.
        robot: String,
    },
}

/// The declared tolerances of a robot with this model.
///
/// # Errors
/// [`UndeclaredError`].
pub fn tolerance(model: &RobotModel, robot: &Description) -> Result<Tolerance, UndeclaredError> {
    match model {
        RobotModel::Faults(_) => of_rover(robot),
        RobotModel::Channels(_) => Err(UndeclaredError::Model {
            robot: robot.name.clone(),
        }),
    }
}

fn of_rover(robot: &Description) -> Result<Tolerance, UndeclaredError> {
    robot.tolerance.ok_or_else(|| UndeclaredError::Tolerance {
        robot: robot.name.clone(),
    })
}

/// One channel's detectors.
#[derive(Debug, Clone, Copy, CheckpointValue)]
struct Wheel {
    rate: Level,
    steer: Level,
    repeats: EDetector,
}

/// The detector over observations.
#[derive(Debug, Clone, Checkpoint)]
pub struct Monitor {
    #[checkpoint(fixed)]
    model: Model,
    #[checkpoint(fixed)]
    robot: Description,
    tolerance: Tolerance,
    #[checkpoint(fixed)]
    null: Null,
    use_wheels: bool,
    #[checkpoint(fixed)]
    promise: Promise,
    lag: LagBounds,
    pose: PoseBlocks,
    wheels: [Wheel; WHEELS],
    is_ready: bool,
    hours: [f64; SLOTS],
    vouched_hours: f64,
    report: DetectionOutput,
}

impl Monitor {
    /// A monitor of these channels.
    ///
    /// # Errors
    /// [`UndeclaredError::Tolerance`].
    pub fn new(
        model: &Model,
        robot: &Description,
        channels: Channels,
        null: Null,
        promise: Promise,
    ) -> Result<Self, UndeclaredError> {
        let correlation = [-null.correlation, null.correlation];
        let tolerance = of_rover(robot)?;
        Ok(Self {
            model: model.clone(),
            robot: robot.clone(),
            tolerance,
            null,
            use_wheels: channels.use_wheels(),
            promise,
            lag: LagBounds::new(model.command.lag_s * model.command.lag_uncertainty),
            pose: PoseBlocks::new(null.correlation),
            wheels: [Wheel {
                rate: Level::new(correlation),
                steer: Level::new(correlation),
                repeats: EDetector::default(),
            }; WHEELS],
            is_ready: false,
            hours: [0.0; SLOTS],
            vouched_hours: 0.0,
            report: DetectionOutput {
                log_odds: LOG_ODDS_MIN,
                channels: [LOG_ODDS_MIN; SLOTS],
                gains: [0.0; SLOTS],
                evidence: 0.0,
                degenerate_count: 0,
            },
        })
    }

    /// Forgets everything.
    pub fn reset(&mut self) {
        self.lag.reset();
        self.is_ready = false;
        self.interrupt();
        self.forget_evidence();
    }

    /// Forgets what speaks for a fault: the promise begins anew.
    pub fn forget_evidence(&mut self) {
        self.pose.forget();
        for wheel in &mut self.wheels {
            wheel.rate.forget();
            wheel.steer.forget();
            wheel.repeats = EDetector::default();
        }
        self.sum_up(Troubles::default(), false);
    }

    /// What the last observation did.
    #[must_use]
    pub const fn report(&self) -> &DetectionOutput {
        &self.report
    }

    /// True after the first observation: there is nothing to learn first.
    #[must_use]
    pub const fn is_ready(&self) -> bool {
        self.is_ready
    }

    /// Mean time between false alarms that an alarm at this observation has at least, h.
    #[must_use]
    pub const fn hours(&self) -> f64 {
        self.vouched_hours
    }

    /// Takes one observation. While an alarm is `standing`, the log-odds keep what a block of poses
    /// has shown until the next one ends: there is nothing to promise then.
    pub fn step(&mut self, observation: &Observation, standing: bool) {
        self.is_ready = true;
        self.lag.advance(observation.command, observation.middles_s);
        if observation.moving && observation.dt_s > 0.0 {
            self.step_pose(observation);
            if self.use_wheels {
                self.step_wheels(observation);
            }
        } else {
            self.interrupt();
        }
        self.sum_up(observation.troubles, standing);
    }

    fn interrupt(&mut self) {
        self.pose.abandon();
        for wheel in &mut self.wheels {
            wheel.rate.interrupt();
            wheel.steer.interrupt();
        }
    }

    fn step_pose(&mut self, observation: &Observation) {
        // A mean of some of the frames is not from their middle.
        if observation.anchor || observation.pose_frames < observation.frames {
            self.pose.skip();
            return;
        }
        let [curvature, speed] = observation.command;
        let limit = self.model.command.curvature_max_1_m;
        let motion = &self.model.nominal.motion;
        let travel_m = speed * observation.middles_s;
        let behind = self.lag.behind();
        let lag_m = behind.speed_m_s * observation.middles_s;
        let lag_rad = behind.yaw_rate_rad_s * observation.middles_s;
        let per_metre = motion.per_metre(curvature, speed, limit);
        let [_, ahead, across] = per_metre;
        let moved = per_metre.map(|per_metre| per_metre * travel_m);
        let (reach_m, turn_rad) = (travel_m.abs() + lag_m, moved[0].abs() + lag_rad);
        let Tolerance {
            yaw_rad_m,
            forward_m_m,
            lateral_m_m,
            ..
        } = self.tolerance;
        let square = self.null.noise_ratio * self.null.noise_ratio;
        let [position, _, yaw] = observation.pose_variance(&self.model, [1.0; 3]);
        self.pose.step(&PoseStep {
            pose: observation.pose,
            moved,
            moved_max: [
                yaw_rad_m * reach_m + forward_m_m * turn_rad + lag_rad,
                forward_m_m * reach_m + ahead.abs().max(1.0) * lag_m,
                lateral_m_m * reach_m + across.abs() * lag_m,
            ],
            moved_variance: motion.white_sd.map(|sd| square * sd * sd * travel_m.abs()),
            noise_variance: [square * yaw, square * position],
            elapsed_h: observation.dt_s / 3600.0,
        });
    }

    fn step_wheels(&mut self, observation: &Observation) {
        let elapsed_h = observation.dt_s / 3600.0;
        let repeat_rate = REPEATS * self.model.encoder.repeat_rate;
        for i in 0..self.robot.wheels.len().min(WHEELS) {
            let rate = self.rate(observation, i);
            let steer = self.steer(observation, i);
            let wheel = &mut self.wheels[i];
            let readings = [(&mut wheel.rate, rate), (&mut wheel.steer, steer)];
            for (level, reading) in readings {
                match reading {
                    Some(reading) => level.step(&reading),
                    None => level.interrupt(),
                }
            }
            let read = &observation.wheels[i];
            if read.count() > 0 {
                let log_e = repeats::log_e(read.repeats, read.plain, repeat_rate);
                wheel.repeats.step(log_e, elapsed_h);
            }
        }
    }

    /// Rate of a wheel beside that of the command.
    fn rate(&self, observation: &Observation, wheel: usize) -> Option<LevelReading> {
        let read = &observation.wheels[wheel];
        let [curvature, speed] = observation.command;
        let rolling = rolling_rate(&self.robot, wheel, curvature, speed);
        let (rate, variance) = self
            .model
            .nominal
            .rates
            .get(wheel)?
            .rate(rolling, curvature);
        let at = self.robot.wheels.get(wheel)?;
        let behind = self.lag.behind();
        let lag_m_s = behind.speed_m_s + behind.yaw_rate_rad_s * at.x.hypot(at.y);
        let lag = lag_m_s / self.robot.wheel_radius_m;
        let tolerance = &self.tolerance;
        let allowed =
            tolerance.wheel_ratio * (rolling.abs() + lag) + tolerance.wheel_rate_rad_s + lag;
        let sd = self.null.noise_ratio * self.model.noise.wheel_rate_rad_s;
        let sample = self.model.sample_variance(sd, observation.frame_s);
        let noise = observation.mean_variance(sample, read.plain) + variance;
        (read.plain > 0).then(|| LevelReading {
            residual: read.mean - rate,
            tolerance: allowed,
            change: f64::INFINITY,
            sd: noise.sqrt(),
            elapsed_h: observation.dt_s / 3600.0,
        })
    }

    /// Angle of a servo beside that of the command.
    fn steer(&self, observation: &Observation, wheel: usize) -> Option<LevelReading> {
        let read = &observation.steer[wheel];
        if !self.robot.wheels.get(wheel)?.steered || read.plain == 0 {
            return None;
        }
        let commanded = steering_angle(&self.robot, wheel, observation.command[0]);
        let behind = self.lag.behind().curvature_1_m;
        // The angle grows or falls with the curvature throughout.
        let lag = [-behind, behind].map(|by| {
            let curvature = observation.command[0] + by;
            (steering_angle(&self.robot, wheel, curvature) - commanded).abs()
        });
        let allowed = self.tolerance.steer_rad + lag[0].max(lag[1]);
        let extra = self.model.nominal.steer_sd_rad;
        let sd = self.null.noise_ratio * self.model.noise.steer_rad;
        let sample = self.model.sample_variance(sd, observation.frame_s);
        let noise = observation.mean_variance(sample, read.plain) + extra * extra;
        Some(LevelReading {
            residual: read.mean - commanded,
            tolerance: allowed,
            change: f64::INFINITY,
            sd: noise.sqrt(),
            elapsed_h: observation.dt_s / 3600.0,
        })
    }

    fn sum_up(&mut self, troubles: Troubles, standing: bool) {
        let before = std::mem::replace(&mut self.hours, [0.0; SLOTS]);
        let count = self.robot.wheels.len().clamp(1, WHEELS);
        if self.use_wheels {
            let steered = self.robot.wheels.iter().filter(|wheel| wheel.steered);
            let servos = steered.count().max(1) as f64;
            for (i, wheel) in self.wheels.iter().enumerate().take(count) {
                let rate =
                    SHARE_WHEELS * wheel.rate.hours() + SHARE_REPEATS * wheel.repeats.hours();
                self.hours[Slot::wheel_rate(i)] = rate / count as f64;
                if self.robot.wheels.get(i).is_some_and(|wheel| wheel.steered) {
                    self.hours[Slot::steer(i)] = SHARE_STEER * wheel.steer.hours() / servos;
                }
            }
        }
        let share = if self.use_wheels { SHARE_POSE } else { 1.0 };
        self.vouched_hours = self.hours.iter().sum::<f64>() + share * self.pose.vouched_hours();
        self.hours[Slot::POSE] = share * self.pose.hours();
        let promise = self.promise;
        self.report.channels = self.hours.map(|hours| promise.log_odds(hours));
        for (channel, gain) in self.report.gains.iter_mut().enumerate() {
            let ratio = (self.hours[channel] / before[channel]).ln();
            *gain = if ratio.is_finite() { ratio } else { 0.0 };
        }
        let hours = match standing {
            true => self.hours.iter().sum(),
            false => self.vouched_hours,
        };
        self.report.log_odds = promise.log_odds(hours);
        self.report_troubles(troubles);
    }

    fn report_troubles(&mut self, troubles: Troubles) {
        let report = &mut self.report;
        let mut trouble = |channel: usize| {
            report.channels[channel] = report.channels[channel].max(TROUBLE_LOG_ODDS);
            report.gains[channel] = TROUBLE_LOG_ODDS;
            report.log_odds = report.log_odds.max(TROUBLE_LOG_ODDS);
        };
        if troubles.pose_silent || troubles.pose_frozen || troubles.pose_moves {
            trouble(Slot::POSE);
        }
        if self.use_wheels {
            let silent = |wheel: &usize| troubles.wheels_silent >> *wheel & 1 == 1;
            for wheel in (0..WHEELS).filter(|wheel| troubles.wheels_turn || silent(wheel)) {
                trouble(Slot::wheel_rate(wheel));
            }
        }
    }
}

#[cfg(test)]
mod tests;
