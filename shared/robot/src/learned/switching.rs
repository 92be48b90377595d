//! The learned model as a hybrid system, for the filters that take any: one fault at a time.
//!
//! Modes: nominal, each stuck wheel, each broken encoder (in any way), two kinds of unknown. The
//! filter over sets of faults does better on this robot; this is what the other filters of
//! the library are run on, live and in comparisons. Where they only sample, the coloured deviations
//! of the motion become white noise of the same power at low frequencies.

use nalgebra::{Cholesky, Matrix3, Vector3};
use rand::RngExt;
use rand_distr::StandardNormal;
use rand_pcg::Pcg64Mcg;
use vigil_blocks::WHEELS;
use vigil_checkpoint::{Checkpoint, CheckpointValue};
use vigil_inference::angle::wrap;
use vigil_inference::gaussian::Gaussian;
use vigil_inference::hybrid::{Conditional, Modes, Sampled};
use vigil_inference::logspace::{log_add, log_normal};
use vigil_inference::outlier::unvouched;
use vigil_inference::track::{Context, Displacement, TRACK_DIMENSION, Track};

use super::{
    FaultRates, Model, MotionMode, Mover, NoiseScales, Observation, WheelContext, WheelEvidence,
    motion_modes,
};
use crate::description::Description;

/// Most modes that there can be: nominal, stuck wheels, broken encoders, unknown.
pub const MODES_MAX: usize = 2 * WHEELS + 3;
/// Share of observations in which wheels may still read as before an onset: the state does not hold
/// when its mode began. 0.15 s of an onset in the ring's 3 s.
const AT_ONSET: f64 = 0.05;
/// Variance below which a motion has no density worth comparing.
const VARIANCE_MIN: f64 = 1e-14;
/// Side of the cells in which poses need not be told apart, m and rad: four deviations of a pose.
const CELL: f64 = 0.02;

/// One mode.
#[derive(Debug, Clone)]
struct Mode {
    moved: Mover,
    /// Wheel whose encoder is broken.
    broken: Option<usize>,
    motion: MotionMode,
    /// Factors of the covariances: the offset's, and the white noise's per metre.
    offset: Matrix3<f64>,
    white: Matrix3<f64>,
}

/// The learned model of one robot with one fault at most.
#[derive(Debug, Clone, Checkpoint)]
pub struct Switching {
    #[checkpoint(fixed)]
    model: Model,
    #[checkpoint(fixed)]
    robot: Description,
    #[checkpoint(fixed)]
    modes: Vec<Mode>,
    /// Row d: `P(d' | d)`.
    transition: Vec<f64>,
    start: Gaussian<3>,
    start_factor: Matrix3<f64>,
    /// Displacement of each mode in the step that comes next.
    steps: [Displacement; MODES_MAX],
    /// Pose and its variances with which the next step begins anew.
    anchor: Option<([f64; 3], [f64; 3])>,
}

/// What is seen in one step.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SwitchingObservation {
    /// Pose (x m, y m, yaw rad) and its variances, if it was measured and is evidence.
    pub pose: Option<([f64; 3], [f64; 3])>,
    /// Log-likelihood of the wheels' readings in each mode.
    pub wheels: [f64; MODES_MAX],
}

/// The continuous state of a particle.
#[derive(Debug, Clone, Copy, PartialEq, CheckpointValue)]
pub struct RoverState {
    /// x m, y m, yaw rad (not wrapped).
    pub pose: Vector3<f64>,
    /// Constant deviation per metre from the mode's motion: yaw, forward, lateral.
    offset: Vector3<f64>,
    family: Family,
}

/// Modes that share an offset: it is drawn anew when the family changes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, CheckpointValue)]
enum Family {
    Nominal,
    Stuck,
    Unknown,
}

impl Mode {
    const fn family(&self) -> Family {
        match self.moved {
            Mover::Nominal | Mover::Pose => Family::Nominal,
            Mover::Stuck(_) => Family::Stuck,
            Mover::Steer(_) | Mover::Unknown | Mover::UnknownAny => Family::Unknown,
        }
    }
}

impl Switching {
    /// The model with faults of the wheels `stuck` and the encoders `encoders` (bits), which come
    /// and go with `rates` per observation.
    #[must_use]
    pub fn new(
        model: &Model,
        robot: &Description,
        stuck: u32,
        encoders: u32,
        rates: &FaultRates,
    ) -> Self {
        let motions = motion_modes(model, robot, stuck, false, false);
        let with = |motion: &MotionMode, broken| {
            let noise = &motion.noise;
            let coloured = noise.deviation * (2.0 * noise.length_m);
            Mode {
                moved: motion.moved,
                broken,
                offset: factor(noise.offset),
                white: factor(coloured + Matrix3::from_diagonal(&noise.white)),
                motion: motion.clone(),
            }
        };
        let (known, unknown) = motions.split_at(motions.len() - 2);
        let mut modes: Vec<Mode> = known.iter().map(|motion| with(motion, None)).collect();
        let broken = (0..WHEELS).filter(|&wheel| encoders >> wheel & 1 == 1);
        modes.extend(broken.map(|wheel| with(&motions[0], Some(wheel))));
        modes.extend(unknown.iter().map(|motion| with(motion, None)));
        let mut switching = Self {
            transition: transitions(&modes, rates, model.interval_s),
            start: Gaussian {
                mean: Vector3::zeros(),
                covariance: Matrix3::zeros(),
            },
            start_factor: Matrix3::zeros(),
            steps: [Displacement {
                per_metre: [0.0; 3],
                travel_m: 0.0,
                extra: [0.0; 3],
            }; MODES_MAX],
            anchor: None,
            model: model.clone(),
            robot: robot.clone(),
            modes,
        };
        // Deviations of 0.01 m and rad, as of a pose of which only a measurement is known.
        switching.start_at(Vector3::zeros(), Matrix3::identity() * 1e-4);
        switching
    }

    /// What moves the robot in a mode, and the wheel whose encoder is broken.
    #[must_use]
    pub fn meaning(&self, mode: usize) -> (Mover, Option<usize>) {
        (self.modes[mode].moved, self.modes[mode].broken)
    }

    /// The pose from which a filter that is reset starts, in the nominal mode.
    pub fn start_at(&mut self, mean: Vector3<f64>, covariance: Matrix3<f64>) {
        self.start = Gaussian { mean, covariance };
        self.start_factor = factor(covariance);
    }

    /// Prepares the step to an observation and says what is seen in it. The observation is to be
    /// one in motion, or an anchor.
    pub fn look(
        &mut self,
        observation: &Observation,
        noise: NoiseScales,
        use_wheels: bool,
    ) -> SwitchingObservation {
        let variance = observation.pose_variance(&self.model, noise.pose);
        let is_measured = observation.pose_frames > 0;
        let pose = is_measured.then_some((observation.pose, variance));
        let anchor = pose.filter(|_| observation.anchor);
        self.anchor = anchor.map(|(pose, variance)| (pose, unvouched(variance)));
        for (step, mode) in self.steps.iter_mut().zip(&self.modes) {
            *step = observation.displacement(&self.model, &mode.motion.motion);
        }
        let mut wheels = [0.0; MODES_MAX];
        if use_wheels && !observation.anchor {
            let evidence = {
                let context = WheelContext::default();
                WheelEvidence::new(&self.model, &self.robot, observation, noise, &context)
            };
            for (sum, mode) in wheels.iter_mut().zip(&self.modes) {
                *sum = self.weigh(mode, observation, &evidence);
            }
        }
        SwitchingObservation {
            pose: pose.filter(|_| !observation.anchor),
            wheels,
        }
    }

    fn weigh(&self, mode: &Mode, observation: &Observation, evidence: &WheelEvidence) -> f64 {
        let count = self.robot.wheels.len().min(WHEELS);
        let sum = |is_new| -> f64 {
            let whole = |wheel| match mode.broken {
                Some(broken) if broken == wheel => evidence.broken_anyhow(wheel),
                _ => evidence.whole(&self.model, observation, &mode.motion, is_new, wheel),
            };
            (0..count).map(whole).sum()
        };
        match mode.moved {
            Mover::Stuck(_) => log_add(
                (1.0 - AT_ONSET).ln() + sum(false),
                AT_ONSET.ln() + sum(true),
            ),
            Mover::UnknownAny => sum(false) + evidence.steering(),
            Mover::Nominal | Mover::Pose | Mover::Unknown | Mover::Steer(_) => sum(false),
        }
    }
}

/// Rows of `P(d' | d)` over one observation.
fn transitions(modes: &[Mode], rates: &FaultRates, interval_s: f64) -> Vec<f64> {
    let mut table = Vec::with_capacity(modes.len() * modes.len());
    for from in modes {
        let start = table.len();
        for to in modes {
            let rate = match (from.broken, to.broken) {
                _ if std::ptr::eq(from, to) => 0.0,
                (_, Some(_)) => rates.fault_1_s,
                (Some(_), None) if to.moved == Mover::Nominal => rates.death_1_s,
                _ => rates.rate_1_s(from.moved, to.moved, 0.0),
            };
            table.push(rate * interval_s);
        }
        let leaving: f64 = table[start..].iter().sum();
        let own = start + start / modes.len();
        table[own] = 1.0 - leaving;
    }
    table
}

/// Lower Cholesky factor; of a covariance that has none, the factor of its diagonal.
fn factor(covariance: Matrix3<f64>) -> Matrix3<f64> {
    let diagonal = || Matrix3::from_diagonal(&covariance.diagonal().map(|v| v.max(0.0).sqrt()));
    Cholesky::new(covariance).map_or_else(diagonal, |factor| factor.l())
}

/// Yaw, forward and lateral displacement with an offset per metre: what slips does not turn.
fn moved(step: &Displacement, offset: &Vector3<f64>) -> Vector3<f64> {
    let mut per_metre = Vector3::from(step.per_metre) + offset;
    per_metre[0] += step.per_metre[0] * offset[1];
    per_metre * step.travel_m
}

/// `ln N(residual; 0, L Lᵀ)`.
fn log_density(factor: &Matrix3<f64>, residual: &Vector3<f64>) -> f64 {
    let diagonal = factor.diagonal();
    let Some(whitened) = factor.solve_lower_triangular(residual) else {
        return f64::NEG_INFINITY;
    };
    let log_determinant: f64 = diagonal.iter().map(|d| d.ln()).sum();
    -0.5 * whitened.norm_squared() - log_determinant - 1.5 * std::f64::consts::TAU.ln()
}

impl Modes for Switching {
    fn modes(&self) -> usize {
        self.modes.len()
    }

    fn transition(&self, from: usize, to: usize) -> f64 {
        self.transition[from * self.modes.len() + to]
    }
}

impl Sampled for Switching {
    type State = RoverState;
    type Observation = SwitchingObservation;

    fn draw(&self, mode: usize, rng: &mut Pcg64Mcg) -> RoverState {
        let mode = &self.modes[mode];
        RoverState {
            pose: self.start.mean + self.start_factor * normal(rng),
            offset: mode.offset * normal(rng),
            family: mode.family(),
        }
    }

    fn propagate(&self, mode: usize, state: &RoverState, rng: &mut Pcg64Mcg) -> RoverState {
        let (step, mode) = (&self.steps[mode], &self.modes[mode]);
        let mut next = *state;
        if next.family != mode.family() {
            (next.family, next.offset) = (mode.family(), mode.offset * normal(rng));
        }
        if let Some((pose, variance)) = self.anchor {
            let sd = Vector3::from(variance).map(f64::sqrt);
            next.pose = Vector3::from(pose) + normal(rng).component_mul(&sd);
            return next;
        }
        let white = mode.white * normal(rng) * step.travel_m.abs().sqrt();
        let lag = normal(rng).component_mul(&Vector3::from(step.extra).map(f64::sqrt));
        let body = moved(step, &next.offset) + white + lag;
        let (sin, cos) = (state.pose[2] + 0.5 * body[0]).sin_cos();
        next.pose[0] += body[1] * cos - body[2] * sin;
        next.pose[1] += body[1] * sin + body[2] * cos;
        next.pose[2] += body[0];
        next
    }

    fn log_likelihood(&self, mode: usize, state: &RoverState, z: &SwitchingObservation) -> f64 {
        let pose = z.pose.map_or(0.0, |(pose, variance)| {
            log_normal(pose[0] - state.pose[0], variance[0])
                + log_normal(pose[1] - state.pose[1], variance[1])
                + log_normal(wrap(pose[2] - state.pose[2]), variance[2])
        });
        pose + z.wheels[mode]
    }

    fn log_motion(&self, mode: usize, before: &RoverState, after: &RoverState) -> f64 {
        let (step, mode) = (&self.steps[mode], &self.modes[mode]);
        if mode.family() != after.family {
            // This mode would have drawn another offset.
            return f64::NEG_INFINITY;
        }
        let entered = before.family != after.family;
        let offset = if entered {
            log_density(&mode.offset, &after.offset)
        } else {
            0.0
        };
        let white = mode.white * mode.white.transpose() * step.travel_m.abs();
        let spread = white + Matrix3::from_diagonal(&Vector3::from(step.extra));
        if self.anchor.is_some() || spread.diagonal().min() < VARIANCE_MIN {
            return offset;
        }
        let apart = after.pose - before.pose;
        let (sin, cos) = (before.pose[2] + 0.5 * apart[2]).sin_cos();
        let body = Vector3::new(
            apart[2],
            apart[0] * cos + apart[1] * sin,
            apart[1] * cos - apart[0] * sin,
        );
        let expected = moved(step, &after.offset);
        offset + log_density(&factor(spread), &(body - expected))
    }

    fn locate(
        &self,
        mode: usize,
        z: &SwitchingObservation,
        rng: &mut Pcg64Mcg,
    ) -> Option<RoverState> {
        let (pose, variance) = z.pose?;
        let sd = Vector3::from(variance).map(f64::sqrt);
        Some(RoverState {
            pose: Vector3::from(pose) + normal(rng).component_mul(&sd),
            ..self.draw(mode, rng)
        })
    }

    fn cell(&self, state: &RoverState) -> u64 {
        let part = |value: f64| ((value / CELL).floor() as i64 & 0xffff) as u64;
        part(state.pose[0]) << 32 | part(state.pose[1]) << 16 | part(wrap(state.pose[2]))
    }
}

impl Conditional<TRACK_DIMENSION> for Switching {
    type Observation = SwitchingObservation;

    fn prior(&self, mode: usize) -> Gaussian<TRACK_DIMENSION> {
        let noise = &self.modes[mode].motion.noise;
        Track::new(self.start.mean, self.start.covariance, noise).into()
    }

    fn enter(&self, from: usize, to: usize, state: &mut Gaussian<TRACK_DIMENSION>) {
        if self.modes[from].moved != self.modes[to].moved {
            *state = Track::from(*state)
                .enter(&Context::default(), &self.modes[to].motion.noise)
                .into();
        }
    }

    fn predict(&self, mode: usize, state: &mut Gaussian<TRACK_DIMENSION>) {
        let mut track = Track::from(*state);
        match self.anchor {
            Some((pose, variance)) => track.anchor(pose, variance),
            None => track.predict(&self.steps[mode], &self.modes[mode].motion.noise),
        }
        *state = track.into();
    }

    fn update(
        &self,
        mode: usize,
        state: &mut Gaussian<TRACK_DIMENSION>,
        z: &SwitchingObservation,
    ) -> Option<f64> {
        let mut track = Track::from(*state);
        let pose = match z.pose {
            Some((pose, variance)) => track.update(pose, variance)?,
            None => 0.0,
        };
        *state = track.into();
        Some(pose + z.wheels[mode])
    }
}

/// Three standard normals.
fn normal(rng: &mut Pcg64Mcg) -> Vector3<f64> {
    Vector3::from_fn(|_, _| rng.sample(StandardNormal))
}
