//! The detection filter over observations: nominal, or not. What else the robot may do is unknown;
//! the learned faults are tried besides, as they are seen sooner so ([`super::faults`]).
//!
//! A Gaussian track follows the pose in the nominal mode ([`Departure`]); residuals are whitened by
//! its predictive density, per group of channels: pose (3), each wheel rate, each steering angle.
//! Per group the fault state takes one [`Form`]: it learns an unknown constant departure, of the
//! motion or of the channel, or has a constant likelihood. An encoder that repeats itself exactly
//! has a flag of its own, and one that is late another (`lateness.rs`); over the pose stands
//! the paper's constant likelihood besides ([`Constant`]). The groups' odds add up: a fault enters
//! by one of them.
//!
//! The belief about the pose is as good as Gaussian, so no particles are needed to find the
//! residuals: 256 of them were too few to tell a misjudged first heading from a fault.

use vigil_blocks::WHEELS;
use vigil_checkpoint::{Checkpoint, CheckpointValue};
use vigil_inference::ages::WhitenedResidual;
use vigil_inference::constant::Constant;
use vigil_inference::departure::{Departure, Suspicion};
use vigil_inference::logspace::{log_normal, log_sum_exp};
use vigil_inference::outlier::unvouched;
use vigil_inference::track::{Displacement, Track};

use super::channels::Channels;
use super::encoder_ways::{EncoderWays, Fits};
use super::faults::{Faults, KINDS};
use super::form::{Evidence, Form, TAU_SQUARED_PER_DIMENSION, log_ratio_any};
use super::further_evidence::FurtherEvidence;
use super::further_watch::Turn;
use super::lateness::{Lateness, Timely};
use super::noise_scale::{NoiseScales, SensorNoise, UNSEEN_S};
use super::repeats::Repeats;
use super::settling::Settling;
use super::wheel_context::{RateResidual, WheelContext};
use super::wheels::rolling_rate;
use super::{Further, Healthy, Model, Observation, SteerReading, Troubles};
use crate::channel_odds::ChannelOdds;
use crate::description::Description;
use crate::slot::{SLOTS, Slot};
use crate::suspects::Suspects;

/// Shares of the prior: how a fault first shows. Chosen: one counts by its logarithm only, half as
/// much is 0.7 nats later.
const SHARE_POSE: f64 = 0.5;
const SHARE_WHEELS: f64 = 0.28;
const SHARE_LATE: f64 = 0.02;
const SHARE_REPEATS: f64 = 0.1;
const SHARE_STEER: f64 = 0.05;
const SHARE_ANY: f64 = 0.05;
/// Standard deviation of a fault's bias in units of the whitened residual: chosen, as it enters the
/// delay by its logarithm only. The pose's learned bias is [`Departure`]'s.
const BIAS_CHANNEL: f64 = 30.0;
/// Log-odds of a channel that is silent, or moves when it should stand: every alarm rises.
const TROUBLE_LOG_ODDS: f64 = 40.0;
/// Diffusion of the pose per observation while following, in units of the measurement's deviation:
/// a steady gain of 0.1, half a second.
const FOLLOWING: f64 = 0.1;
/// Squared norm beyond which a single residual says no more for a deviation of any kind: it takes
/// several to tell one from an outlier, as each gives 3.6 nats at most.
const ANY_NORM_MAX: f64 = 12.0;
/// Residuals beyond this many deviations mean a lost track: an outlier's own.
const LOST: f64 = 10.0;
/// Time in motion after which evidence counts if the noise is known, s: twenty observations;
/// otherwise it does after [`UNSEEN_S`].
const READY_S: f64 = 1.0;
/// Observations in a row without usable weights after which the pose starts anew: half a second.
const COAST_MAX: u32 = 10;

/// The detection filter.
#[derive(Debug, Clone, Checkpoint)]
pub struct Monitor {
    #[checkpoint(fixed)]
    model: Model,
    #[checkpoint(fixed)]
    robot: Description,
    #[checkpoint(fixed)]
    channels: Channels,
    #[checkpoint(fixed)]
    form: Form,
    fault_rate_1_s: f64,
    tracking: bool,
    coasted: u32,
    settling: Settling,
    departure: Departure<KINDS>,
    faults: Faults,
    context: WheelContext,
    pose: Evidence<3>,
    wheels: [Evidence<1>; WHEELS],
    ways: [EncoderWays; WHEELS],
    steer: [Evidence<1>; WHEELS],
    repeats: [Repeats; WHEELS],
    late: Lateness,
    any: Constant,
    noise: SensorNoise,
    troubles: Troubles,
    #[checkpoint(each)]
    further: Option<Box<FurtherEvidence>>,
    gains: Gains,
    report: DetectionOutput,
}

/// What the last observation said for a fault in each group of channels.
#[derive(Debug, Clone, Copy, Default, CheckpointValue)]
struct Gains {
    pose: f64,
    any: f64,
    wheels: [f64; WHEELS],
    steer: [f64; WHEELS],
}

/// Result of the last observation.
#[derive(Debug, Clone, Copy, PartialEq, CheckpointValue)]
pub struct DetectionOutput {
    /// Natural log-odds that the robot is not in its nominal mode.
    pub log_odds: f64,
    /// The same by each channel alone; see [`Slot`].
    pub channels: [f64; SLOTS],
    /// What the observation said in each channel for a fault that was there, and is: the logarithm
    /// of the likelihoods' ratio; 0 where nothing is evidence.
    pub gains: [f64; SLOTS],
    /// Log-likelihood of the observation under the nominal mode.
    pub evidence: f64,
    /// Observations that the track could not take.
    pub degenerate_count: u32,
}

impl Monitor {
    /// A monitor with a prior fault rate; `form` holds for every group.
    #[must_use]
    pub fn new(
        model: &Model,
        robot: &Description,
        channels: Channels,
        form: Form,
        fault_rate_1_h: f64,
    ) -> Self {
        let mut monitor = Self {
            model: model.clone(),
            robot: robot.clone(),
            channels,
            form,
            fault_rate_1_s: fault_rate_1_h / 3600.0,
            tracking: false,
            coasted: 0,
            settling: Settling::default(),
            departure: Departure::new(model.nominal_noise(robot)),
            faults: Faults::new(model, robot),
            context: WheelContext::new(robot.tolerance),
            pose: Evidence::new(form, BIAS_CHANNEL),
            wheels: [Evidence::new(form, BIAS_CHANNEL); WHEELS],
            ways: [EncoderWays::default(); WHEELS],
            steer: [Evidence::new(form, BIAS_CHANNEL); WHEELS],
            repeats: [Repeats::default(); WHEELS],
            late: Lateness::default(),
            any: Constant::default(),
            noise: SensorNoise::default(),
            troubles: Troubles::default(),
            further: match channels {
                Channels::All => FurtherEvidence::new(model, robot, form).map(Box::new),
                _ => None,
            },
            gains: Gains::default(),
            report: DetectionOutput {
                log_odds: f64::NEG_INFINITY,
                channels: [f64::NEG_INFINITY; SLOTS],
                gains: [0.0; SLOTS],
                evidence: 0.0,
                degenerate_count: 0,
            },
        };
        monitor.reset();
        monitor
    }

    /// Forgets everything.
    pub fn reset(&mut self) {
        self.tracking = false;
        self.coasted = 0;
        self.late = Lateness::default();
        self.context = WheelContext::new(self.robot.tolerance);
        self.noise = SensorNoise::default();
        self.troubles = Troubles::default();
        self.report.evidence = 0.0;
        if let Some(further) = &mut self.further {
            further.reset(&self.robot);
        }
        self.forget_evidence();
    }

    /// Forgets what speaks for a fault, and keeps the track.
    pub fn forget_evidence(&mut self) {
        self.departure.forget();
        self.pose = Evidence::new(self.form, BIAS_CHANNEL);
        self.wheels = [Evidence::new(self.form, BIAS_CHANNEL); WHEELS];
        self.ways = [EncoderWays::default(); WHEELS];
        self.steer = [Evidence::new(self.form, BIAS_CHANNEL); WHEELS];
        self.repeats = [Repeats::default(); WHEELS];
        self.late.forget();
        self.any = Constant::default();
        self.gains = Gains::default();
        if let Some(further) = &mut self.further {
            further.forget();
        }
        self.sum_up();
    }

    /// Result of the last observation.
    #[must_use]
    pub const fn report(&self) -> &DetectionOutput {
        &self.report
    }

    /// Where the robot is if it is nominal.
    #[must_use]
    pub const fn track(&self) -> &Track {
        self.departure.track()
    }

    /// What is believed of the robot as long as it is healthy; None before its first pose.
    #[must_use]
    pub fn healthy(&self) -> Option<Healthy> {
        self.tracking.then(|| Healthy {
            pose: self.track().pose(),
            covariance: self.track().pose_covariance(),
            context: *self.departure.context(),
            wheels: self.context,
        })
    }

    /// True once evidence counts: the track has settled, and the noise is known or the drive shows
    /// nothing of it for long; or something is the matter that needs no evidence.
    #[must_use]
    pub fn is_ready(&self) -> bool {
        let use_wheels = self.channels.use_wheels();
        let further = self.further.as_ref();
        let is_known =
            self.noise.is_known(use_wheels) && further.is_none_or(|further| further.is_known());
        let moved_s = self.noise.moved_s();
        moved_s >= READY_S && (is_known || moved_s >= UNSEEN_S) || self.troubles.any(use_wheels)
    }

    /// How noisy the sensors are.
    #[must_use]
    pub const fn noise(&self) -> &SensorNoise {
        &self.noise
    }

    /// Probability that a fault appears in `dt_s`, in one of the groups with this share. Chosen: at
    /// most a tenth, as no observation is mostly faults. At least what has a logarithm.
    fn birth(&self, dt_s: f64, share: f64) -> f64 {
        (self.fault_rate_1_s * dt_s * share).clamp(1e-300, 0.1)
    }

    /// Takes one observation. While `following`, the pose track gives way to the measurement, so
    /// that the return of a robot to its nominal mode is seen after a fault has led it away.
    /// `further`: what the observation holds of gyro and currents.
    pub fn step(&mut self, observation: &Observation, further: Option<&Further>, following: bool) {
        let suspects = Suspects::new(following, &self.report.channels);
        if let Some(read) = further
            && let Some(mut evidence) = self.further.take()
        {
            let turned = |step: &Displacement| self.track().turn(step);
            let turn = match self.tracking {
                true => Turn::expected(&self.model, observation, turned),
                false => None,
            };
            let birth = |share| self.birth(observation.dt_s, share);
            let (model, robot) = (&self.model, &self.robot);
            evidence.step(model, robot, (observation, read), (turn, suspects), birth);
            self.further = Some(evidence);
        }
        self.report.evidence = 0.0;
        self.gains = Gains::default();
        self.troubles = observation.troubles;
        let (model, robot) = (&self.model, &self.robot);
        self.noise.update(model, robot, observation, suspects);
        let scales = self.noise.scales();
        self.step_pose(observation, following, scales);
        if observation.moving && self.channels.use_wheels() {
            self.step_wheels(observation, suspects, scales);
            self.step_steer(observation, scales);
        } else if self.channels.use_wheels() {
            self.late.rest(observation.t_ns);
        }
        self.sum_up();
    }

    fn step_pose(&mut self, observation: &Observation, following: bool, scales: NoiseScales) {
        let variance = observation.pose_variance(&self.model, scales.pose);
        let measured = observation.pose_frames > 0;
        if !self.tracking {
            if measured {
                self.departure.start(observation.pose, unvouched(variance));
                self.tracking = true;
                self.settling.begin();
            }
            return;
        }
        if observation.anchor || self.coasted >= COAST_MAX {
            if measured {
                self.departure.anchor(observation.pose, unvouched(variance));
                self.coasted = 0;
                self.settling.begin();
            }
            return;
        }
        let step = observation.displacement(&self.model, &self.model.nominal.motion);
        // Other forms read the residual of the nominal track only.
        let counts = observation.moving && self.form == Form::LearnedBias;
        let birth = match counts {
            true => self.birth(observation.dt_s, SHARE_POSE),
            false => 0.0,
        };
        let suspected = following.then(|| Suspicion {
            variance: variance.map(|variance| FOLLOWING * FOLLOWING * variance),
            // At rest no fault ends.
            ends: self.robot.fault_prior.mended_1_s * observation.moved_s(),
        });
        let kinds = self.faults.kinds(&self.model, observation, &step);
        self.departure.predict(&step, &kinds, birth, suspected);
        if measured {
            let rates = scales.outliers.pose;
            let trusted = self.departure.trusted(observation.pose, variance, rates);
            let agrees = (0..3).all(|axis| trusted[axis] < 2.0 * variance[axis]);
            if self.settling.take(agrees) {
                self.weigh_pose(observation, trusted);
            } else {
                self.departure.anchor(observation.pose, unvouched(variance));
            }
        }
    }

    /// Evidence of the pose's residual. A standing robot tells nothing about its motion, but its
    /// pose stays known.
    fn weigh_pose(&mut self, observation: &Observation, variance: [f64; 3]) {
        let counts = observation.moving && self.settling.is_over();
        let Some(said) = self.departure.update(observation.pose, variance, counts) else {
            self.coasted += 1;
            self.report.degenerate_count += 1;
            return;
        };
        let norm = said.residual.norm_squared();
        let lost = norm >= LOST * LOST;
        self.coasted = if lost { self.coasted + 1 } else { 0 };
        if !counts {
            return;
        }
        self.gains.pose = match self.form {
            Form::LearnedBias => self.departure.gain(),
            Form::Constant | Form::Windowed => {
                let birth = self.birth(observation.dt_s, SHARE_POSE);
                self.pose
                    .step(&WhitenedResidual::usual(said.residual), birth);
                self.pose.gain()
            }
        };
        let birth = self.birth(observation.dt_s, SHARE_ANY);
        let norm = norm.min(ANY_NORM_MAX);
        self.any
            .step(norm, 3.0 * TAU_SQUARED_PER_DIMENSION, birth, birth);
        self.gains.any = self.any.gain();
        self.report.evidence += said.log_density;
    }

    fn step_wheels(&mut self, observation: &Observation, suspects: Suspects, scales: NoiseScales) {
        let learned = self.model.noise.wheel_rate_rad_s;
        let samples = observation.sample_variances(&self.model, learned, scales.wheels);
        let share = 1.0 / self.robot.wheels.len() as f64;
        let birth = self.birth(observation.dt_s, SHARE_WHEELS * share);
        let birth_repeats = self.birth(observation.dt_s, SHARE_REPEATS * share);
        let command = observation.command;
        self.context.fade(observation.travel_m);
        let mut fits = [Fits::default(); WHEELS];
        let (mut all, mut timely, mut rates) =
            ([None; WHEELS], [None; WHEELS], [(0.0, 0.0); WHEELS]);
        let wheels = self.robot.wheels.len();
        for (i, sample) in samples.into_iter().enumerate().take(wheels) {
            let reading = &observation.wheels[i];
            let healthy = self.model.encoder.repeat_rate;
            fits[i].repeats = self.repeats[i].step(reading, healthy, birth_repeats);
            let rolling = rolling_rate(&self.robot, i, command[0], command[1]);
            let behind =
                rolling - rolling_rate(&self.robot, i, observation.curvature, observation.speed);
            let (rate, variance) = self.model.nominal.rates[i].rate(rolling, command[0]);
            let (shift, uncertain) = self.context.shift(i, rolling);
            let variance = variance + behind * behind;
            rates[i] = (rate + shift, variance + uncertain);
            if reading.plain == 0 {
                continue;
            }
            let noise = observation.mean_variance(sample, reading.plain);
            let variance = variance + noise;
            all[i] = Some(RateResidual {
                residual_rad_s: reading.mean - rate,
                rolling_rad_s: rolling,
                variance,
            });
            let (apart, variance) = (reading.mean - rate - shift, variance + uncertain);
            let outlier_rate = scales.outliers.wheels[i];
            let whitened = WhitenedResidual::new(apart, variance, behind * behind, outlier_rate);
            timely[i] = Some(Timely {
                read_rad_s: reading.mean,
                residual_rad_s: apart,
                variance,
                noise,
                outlier_rate,
            });
            self.wheels[i].step(&whitened, birth);
            fits[i].biased = self.wheels[i].gain();
            fits[i].any = log_ratio_any(whitened.value.norm_squared());
            self.report.evidence += log_normal(apart, variance);
        }
        // What a fault does is no context of the nominal mode.
        if !suspects.has_wheel_rate() {
            self.context.learn(&all);
        }
        let birth = self.birth(observation.dt_s, SHARE_LATE * share);
        self.late.step(observation.t_ns, rates, &timely, birth);
        for (i, fits) in fits.iter_mut().enumerate().take(wheels) {
            fits.late = self.late.odds(i).1;
            self.gains.wheels[i] = self.ways[i].step(fits);
        }
    }

    fn step_steer(&mut self, observation: &Observation, scales: NoiseScales) {
        let steered = self.robot.wheels.iter().filter(|wheel| wheel.steered);
        let share = SHARE_STEER / steered.count().max(1) as f64;
        let birth = self.birth(observation.dt_s, share);
        let readings = SteerReading::all(&self.model, &self.robot, observation, &scales);
        for (i, reading) in readings.iter().enumerate() {
            let Some(reading) = reading else {
                continue;
            };
            self.steer[i].step(&reading.whitened(), birth);
            self.gains.steer[i] = self.steer[i].gain();
            self.report.evidence += log_normal(reading.beyond_rad, reading.variance);
        }
    }

    fn sum_up(&mut self) {
        let mut odds = ChannelOdds::none();
        let mut enter = |channel: usize, log_odds: f64, gain: f64| {
            odds.enter(channel, log_odds, log_odds - gain);
        };
        let pose = match self.form {
            Form::LearnedBias => self.departure.log_odds(),
            Form::Constant | Form::Windowed => self.pose.log_odds(),
        };
        let gains = &self.gains;
        enter(Slot::POSE, pose, gains.pose);
        enter(Slot::ANY, self.any.log_odds(), gains.any);
        if self.channels.use_wheels() {
            for i in 0..self.robot.wheels.len() {
                let channel = Slot::wheel_rate(i);
                enter(channel, self.wheels[i].log_odds(), gains.wheels[i]);
                enter(channel, self.repeats[i].log_odds, gains.wheels[i]);
                enter(channel, self.late.odds(i).0, gains.wheels[i]);
                if self.robot.wheels[i].steered {
                    enter(Slot::steer(i), self.steer[i].log_odds(), gains.steer[i]);
                }
            }
        }
        if let Some(further) = &self.further {
            further.channels(enter);
        }
        let mut channels = odds.by_channel();
        self.report.gains = odds.gains();
        let mut trouble = |channel: usize| {
            channels[channel] = channels[channel].max(TROUBLE_LOG_ODDS);
            self.report.gains[channel] = TROUBLE_LOG_ODDS;
        };
        let Troubles {
            pose_silent,
            pose_frozen,
            pose_moves,
            wheels_turn,
            wheels_silent,
            wheels_stand: _,
        } = self.troubles;
        if pose_silent || pose_frozen || pose_moves {
            trouble(Slot::POSE);
        }
        if self.channels.use_wheels() {
            for wheel in (0..WHEELS).filter(|w| wheels_turn || wheels_silent >> w & 1 == 1) {
                trouble(Slot::wheel_rate(wheel));
            }
        }
        self.report.log_odds = log_sum_exp(&channels).max(LOG_ODDS_MIN);
        self.report.channels = channels.map(|value| value.max(LOG_ODDS_MIN));
    }
}

/// Log-odds below this are reported as this: no evidence for a fault at all.
const LOG_ODDS_MIN: f64 = -700.0;
