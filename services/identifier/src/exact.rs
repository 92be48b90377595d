//! Exact Bayes over nominal, single faults and the unknown.
//!
//! The motion tells stuck wheels apart: one track per (mode, onset). Broken encoders do not move
//! the robot: under nominal motion a small hidden Markov model says which encoder does what. A
//! stuck wheel's encoder reads zero with the sensor's noise. The unknown is nominal motion with a
//! large constant deviation, and wheels that may do anything.

use nalgebra::{Matrix3, Vector3};
use vigil_blocks::WHEELS;
use vigil_inference::bank::{Bank, Hypothesis};
use vigil_inference::logspace::{log_add, log_normal};
use vigil_inference::track::{Displacement, MotionNoise, Track};
use vigil_robot::Description;
use vigil_robot::learned::wheels::{rolling_rate, steering_angle};
use vigil_robot::learned::{EncoderState, Model, MotionModel, Observation};

use crate::encoders::{Births, Encoders};
use crate::modes::Leaves;
use crate::posterior::Posterior;

/// Motion modes: nominal, each wheel stuck, two kinds of unknown.
pub const MOTIONS: usize = WHEELS + 3;
/// Index of the nominal motion.
pub const NOMINAL: usize = 0;
/// Index of the unknown motion whose wheels turn as commanded.
pub const UNKNOWN: usize = WHEELS + 1;
/// Index of the unknown motion whose wheels and steering may do anything.
const UNKNOWN_ANY: usize = WHEELS + 2;
/// Onset hypotheses kept per mode.
const PER_MODE: usize = 32;
/// Hypotheses less probable than this are dropped (natural logarithm).
const FLOOR: f64 = -30.0;
/// A new onset is supposed every so many observations in motion.
const ONSET_STRIDE: u32 = 1;
/// So long after a supposed onset, ns, a stuck wheel's encoder may read anything (an observation
/// may hold the very moment), and the other wheels may still turn as before: the robot slows down
/// within a few tenths of a second.
const ONSET_BLUR_NS: u64 = 150_000_000;
/// Prior rate of faults while something is suspected, 1/s of motion. An alarm has been raised:
/// the rate over a robot's life would make the filter slow without making it more often right.
pub const BIRTH_1_S: f64 = 0.01;
/// Rate at which faults vanish, 1/s of motion.
pub const DEATH_1_S: f64 = 1.0 / 60.0;
/// The unknown: standard deviation of its constant deviation per metre (yaw, forward, lateral).
const UNKNOWN_SD: [f64; 3] = [0.25, 0.2, 0.12];
/// Soil other than that learned from: deviation of a stuck wheel's effect, relative to the effect.
const TERRAIN: f64 = 0.1;
/// Share of healthy wheels' rates in the tail: while all is well, and while another wheel drags.
const TAIL: f64 = 0.02;
const TAIL_DRAGGED: f64 = 0.1;
/// Share of wheels that do anything, in the unknown.
const ANYTHING: f64 = 0.2;
/// Standard deviation of a steering angle that does anything, rad.
const STEER_ANY_RAD: f64 = 0.3;

/// One way to move.
#[derive(Debug, Clone)]
struct Mode {
    motion: MotionModel,
    noise: MotionNoise,
    /// Prior share among faults; 0 for a mode that the tree lacks.
    share: f64,
}

/// Continuous state of a hypothesis, and what its encoders do. Each nominal hypothesis has its own
/// encoders: a robot that has recovered from a stuck wheel has healthy ones.
#[derive(Debug, Clone, Copy)]
pub struct State {
    /// Pose and deviations.
    pub track: Track,
    /// Encoders under nominal motion; not used by other modes.
    pub encoders: Encoders,
}

/// The filter.
#[derive(Debug, Clone)]
pub struct Exact {
    model: Model,
    robot: Description,
    leaves: Leaves,
    use_wheels: bool,
    modes: Vec<Mode>,
    bank: Bank<State>,
    births: Births,
    since_spawn: u32,
    spawn_s: f64,
    degenerate_count: u32,
}

impl Exact {
    /// A filter over the leaves of a tree. `p_unknown` is the prior share of the unknown.
    #[must_use]
    pub fn new(
        model: &Model,
        robot: &Description,
        leaves: &Leaves,
        use_wheels: bool,
        p_unknown: f64,
    ) -> Self {
        let each = (1.0 - p_unknown) / leaves.count.max(1) as f64;
        let nominal = &model.nominal.motion;
        let modes = (0..MOTIONS)
            .map(|mode| match mode {
                NOMINAL => Mode {
                    motion: *nominal,
                    noise: nominal.noise(),
                    share: 0.0,
                },
                UNKNOWN.. => Mode {
                    motion: *nominal,
                    noise: unknown_noise(model),
                    share: 0.5 * p_unknown,
                },
                _ => stuck_mode(
                    model,
                    mode - 1,
                    leaves.stuck[mode - 1].map_or(0.0, |_| each),
                ),
            })
            .collect();
        Self {
            model: model.clone(),
            robot: robot.clone(),
            leaves: leaves.clone(),
            use_wheels,
            modes,
            bank: Bank::new(MOTIONS, PER_MODE),
            births: Births::new(leaves, if use_wheels { each } else { 0.0 }),
            since_spawn: 0,
            spawn_s: 0.0,
            degenerate_count: 0,
        }
    }

    /// Starts from the nominal mode, its pose known to `moments` at `t_ns`.
    pub fn restart(&mut self, mean: Vector3<f64>, covariance: Matrix3<f64>, t_ns: u64) {
        let track = Track::new(mean, covariance, &self.modes[NOMINAL].noise);
        self.bank.restart(
            NOMINAL,
            t_ns,
            State {
                track,
                encoders: Encoders::healthy(t_ns),
            },
        );
        (self.since_spawn, self.spawn_s) = (0, 0.0);
    }

    /// Observations that were impossible under every hypothesis, and were passed over.
    #[must_use]
    pub const fn degenerate_count(&self) -> u32 {
        self.degenerate_count
    }

    /// The hypotheses; `mode` is 0 nominal, 1 + wheel stuck, [`UNKNOWN`].
    #[must_use]
    pub fn hypotheses(&self) -> &[Hypothesis<State>] {
        self.bank.hypotheses()
    }

    /// Takes one observation; the pose's noise is `noise_scale` times the learned one.
    pub fn step(&mut self, observation: &Observation, noise_scale: f64) {
        let variance = self.pose_variance(observation, noise_scale);
        if observation.anchor {
            if observation.pose_frames > 0 {
                for hypothesis in self.bank.hypotheses_mut() {
                    hypothesis.state.track.anchor(observation.pose, variance);
                }
            }
            return;
        }
        if observation.moving {
            self.spawn_s += observation.dt_s;
            self.since_spawn += 1;
            if self.since_spawn >= ONSET_STRIDE {
                self.spawn(observation.t_first_ns);
            }
        }
        self.predict(observation);
        // A robot at rest tells nothing: no fault appears, fades or is named.
        if !observation.moving {
            return;
        }
        let (mut wheels, mut at_onset) = ([0.0; MOTIONS], [0.0; MOTIONS]);
        if self.use_wheels {
            self.weigh_wheels(observation, &mut wheels, &mut at_onset);
        }
        let t_ns = observation.t_ns;
        let mut failed = false;
        for hypothesis in self.bank.hypotheses_mut() {
            let is_new = t_ns.saturating_sub(hypothesis.onset) < ONSET_BLUR_NS;
            let mut gained = if is_new { at_onset } else { wheels }[hypothesis.mode];
            if observation.pose_frames > 0 {
                match hypothesis.state.track.update(observation.pose, variance) {
                    Some(log_likelihood) => gained += log_likelihood,
                    None => failed = true,
                }
            }
            hypothesis.log_weight += gained;
        }
        if failed || self.bank.normalise(FLOOR).is_none() {
            self.degenerate_count = self.degenerate_count.saturating_add(1);
        }
    }

    fn pose_variance(&self, observation: &Observation, noise_scale: f64) -> [f64; 3] {
        let noise = &self.model.noise;
        let ratio = noise_scale * noise_scale;
        [noise.position_m, noise.position_m, noise.yaw_rad].map(|sd| {
            let sample = self.model.sample_variance(sd, observation.frame_s) * ratio;
            observation.mean_variance(sample, observation.pose_frames)
        })
    }

    fn predict(&mut self, observation: &Observation) {
        let limit = self.model.command.curvature_max_1_m;
        let extra = observation.lag_variance(&self.model);
        let mut steps = [Displacement {
            per_metre: [0.0; 3],
            travel_m: 0.0,
            extra,
        }; MOTIONS];
        for (step, mode) in steps.iter_mut().zip(&self.modes) {
            step.travel_m = observation.travel_m;
            step.per_metre = mode
                .motion
                .per_metre(observation.curvature, observation.speed, limit);
        }
        for hypothesis in self.bank.hypotheses_mut() {
            let noise = &self.modes[hypothesis.mode].noise;
            hypothesis
                .state
                .track
                .predict(&steps[hypothesis.mode], noise);
        }
    }

    /// New hypotheses: from nominal to each fault; from the most probable fault to nominal and to
    /// each other fault.
    fn spawn(&mut self, t_ns: u64) {
        let (birth, death) = (BIRTH_1_S * self.spawn_s, DEATH_1_S * self.spawn_s);
        (self.since_spawn, self.spawn_s) = (0, 0.0);
        let nominal = self.bank.best(|mode| mode == NOMINAL).copied();
        let fault = self.bank.best(|mode| mode != NOMINAL).copied();
        for from in [nominal, fault].into_iter().flatten() {
            for mode in 0..MOTIONS {
                let share = if mode == NOMINAL {
                    death
                } else {
                    birth * self.modes[mode].share
                };
                let log_weight = from.log_weight + share.ln();
                if mode == from.mode || log_weight <= FLOOR {
                    continue;
                }
                let state = State {
                    track: from.state.track.fork(&self.modes[mode].noise),
                    encoders: Encoders::healthy(t_ns),
                };
                self.bank.add(Hypothesis {
                    mode,
                    onset: t_ns,
                    log_weight,
                    state,
                });
            }
        }
    }

    /// Log-likelihood of the wheels' readings under each motion mode: in general, and for a mode
    /// that has just begun.
    fn weigh_wheels(
        &mut self,
        observation: &Observation,
        out: &mut [f64; MOTIONS],
        at_onset: &mut [f64; MOTIONS],
    ) {
        let count = self.robot.wheels.len();
        let encoder = self.model.encoder;
        let sd = self.model.noise.wheel_rate_rad_s;
        let sample_sd = self.model.sample_variance(sd, observation.frame_s).sqrt();
        let command = observation.command;
        let mut rolling = [(0.0, 0.0); WHEELS];
        let mut healthy = [0.0; WHEELS];
        for i in 0..count {
            let rate = rolling_rate(&self.robot, i, command[0], command[1]);
            let lagged = rolling_rate(&self.robot, i, observation.curvature, observation.speed);
            rolling[i] = (rate, (rate - lagged) * (rate - lagged));
            let (mean, variance) = self.model.nominal.rates[i].rate(rate, command[0]);
            let turning = EncoderState::Turning(mean, variance + rolling[i].1, TAIL);
            healthy[i] = encoder.log_likelihood(turning, &observation.wheels[i], sample_sd);
        }
        let patterns = self
            .births
            .patterns(&encoder, observation, sample_sd, &healthy[..count]);
        let (birth, death) = (BIRTH_1_S * observation.dt_s, DEATH_1_S * observation.dt_s);
        for hypothesis in self
            .bank
            .hypotheses_mut()
            .iter_mut()
            .filter(|h| h.mode == NOMINAL)
        {
            let encoders = &mut hypothesis.state.encoders;
            hypothesis.log_weight += encoders.step(
                &self.births,
                birth,
                death,
                &patterns,
                observation.t_first_ns,
            );
        }
        out[UNKNOWN] = healthy[..count].iter().sum();
        out[UNKNOWN_ANY] = self.steering(observation);
        for (reading, health) in observation.wheels.iter().zip(&healthy[..count]) {
            let any = encoder.log_likelihood(EncoderState::Any, reading, sample_sd);
            out[UNKNOWN_ANY] += log_add((1.0 - ANYTHING).ln() + health, ANYTHING.ln() + any);
        }
        *at_onset = *out;
        for wheel in 0..count {
            let dragging = self.weigh_dragging(observation, wheel, &rolling, &healthy, sample_sd);
            if let Some(dragging) = dragging {
                (out[1 + wheel], at_onset[1 + wheel]) = dragging;
            }
        }
    }

    /// Log-likelihood of the wheels' readings while `wheel` drags: in general, and at its onset.
    fn weigh_dragging(
        &self,
        observation: &Observation,
        wheel: usize,
        rolling: &[(f64, f64); WHEELS],
        healthy: &[f64; WHEELS],
        sample_sd: f64,
    ) -> Option<(f64, f64)> {
        if self.modes[1 + wheel].share <= 0.0 {
            return None;
        }
        let stuck = self.model.stuck(wheel)?;
        let encoder = self.model.encoder;
        let read =
            |i: usize, state| encoder.log_likelihood(state, &observation.wheels[i], sample_sd);
        let even = |a: f64, b: f64| log_add(a, b) - std::f64::consts::LN_2;
        let (mut dragged, mut at_onset) = (0.0, 0.0);
        for i in (0..self.robot.wheels.len()).filter(|&i| i != wheel) {
            let (mean, variance) = stuck.rates[i].rate(rolling[i].0, observation.command[0]);
            let turning = EncoderState::Turning(mean, variance + rolling[i].1, TAIL_DRAGGED);
            let log_likelihood = read(i, turning);
            dragged += log_likelihood;
            at_onset += even(log_likelihood, healthy[i]);
        }
        let standing = read(wheel, EncoderState::Turning(0.0, 4e-4, TAIL));
        let anything = read(wheel, EncoderState::Any);
        Some((dragged + standing, at_onset + even(standing, anything)))
    }

    /// What the steering angles say for the unknown: relative to angles as commanded, which every
    /// named mode has.
    fn steering(&self, observation: &Observation) -> f64 {
        let sample = self
            .model
            .sample_variance(self.model.noise.steer_rad, observation.frame_s);
        let extra = self.model.nominal.steer_sd_rad;
        let mut sum = 0.0;
        for i in (0..self.robot.wheels.len()).filter(|&i| self.robot.wheels[i].steered) {
            let reading = &observation.steer[i];
            if reading.plain == 0 {
                continue;
            }
            let angle = steering_angle(&self.robot, i, observation.command[0]);
            let behind = angle - steering_angle(&self.robot, i, observation.curvature);
            let noise = observation.mean_variance(sample, reading.plain);
            let variance = noise + extra * extra + behind * behind;
            let apart = reading.mean - angle;
            let wide = variance + STEER_ANY_RAD * STEER_ANY_RAD;
            let ratio = log_normal(apart, wide) - log_normal(apart, variance);
            sum += log_add((1.0 - ANYTHING).ln(), ANYTHING.ln() + ratio.min(30.0));
        }
        sum
    }

    /// Probabilities of nominal, leaves and unknown.
    #[must_use]
    pub fn posterior(&self) -> Posterior {
        let mut out = Posterior::nominal();
        out.nodes[0] = 0.0;
        for hypothesis in self.bank.hypotheses() {
            let p = hypothesis.log_weight.exp();
            match hypothesis.mode {
                NOMINAL => {
                    let encoders = &hypothesis.state.encoders;
                    out.nodes[0] += p * encoders.p_healthy();
                    for (wheel, leaf) in self.leaves.encoder.iter().enumerate() {
                        if let Some(node) = leaf {
                            out.nodes[*node] += p * encoders.p_broken(wheel);
                        }
                    }
                }
                UNKNOWN.. => out.unknown += p,
                stuck => {
                    if let Some(node) = self.leaves.stuck[stuck - 1] {
                        out.nodes[node] += p;
                    }
                }
            }
        }
        out.normalise(&self.leaves);
        out
    }

    /// Most probable onset of a node's fault, capture time ns; 0 if it is no leaf.
    #[must_use]
    pub fn onset(&self, node: usize) -> u64 {
        if let Some(wheel) = self
            .leaves
            .stuck
            .iter()
            .position(|&leaf| leaf == Some(node))
        {
            return self
                .bank
                .best(|mode| mode == 1 + wheel)
                .map_or(0, |best| best.onset);
        }
        if let Some(wheel) = self
            .leaves
            .encoder
            .iter()
            .position(|&leaf| leaf == Some(node))
        {
            let best = self.bank.best(|mode| mode == NOMINAL);
            return best.map_or(0, |best| best.state.encoders.onset(wheel));
        }
        0
    }
}

fn unknown_noise(model: &Model) -> MotionNoise {
    let nominal = model.nominal.motion.noise();
    // As coloured as the stuck modes: an unknown fault meets the same soil.
    let coloured = model
        .stuck
        .iter()
        .map(|stuck| stuck.motion.noise().deviation);
    let count = model.stuck.len().max(1) as f64;
    let deviation = coloured.fold(Matrix3::zeros(), |sum, next| sum + next) / count;
    let square = |sd: f64| sd * sd;
    MotionNoise {
        offset: Matrix3::from_diagonal(&Vector3::from(UNKNOWN_SD.map(square))),
        deviation: Matrix3::from_diagonal(&deviation.diagonal()) + nominal.deviation,
        length_m: 0.2,
        white: nominal.white * 4.0,
    }
}

/// A wheel stuck. Another soil changes the size of the effect, not its sign: the run's offset may
/// also lie along the effect itself.
fn stuck_mode(model: &Model, wheel: usize, share: f64) -> Mode {
    let motion = model
        .stuck(wheel)
        .map_or(model.nominal.motion, |stuck| stuck.motion);
    let nominal = &model.nominal.motion;
    let effect = Vector3::new(
        motion.yaw.curvature[0] - nominal.yaw.curvature[0],
        motion.forward.curvature[0] - nominal.forward.curvature[0],
        0.0,
    );
    let mut noise = motion.noise();
    noise.offset += effect * effect.transpose() * (TERRAIN * TERRAIN);
    Mode {
        motion,
        noise,
        share,
    }
}
