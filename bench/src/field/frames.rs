//! What becomes of frames between the robot and the detector: noise of other kinds, drift, loss.

use rand::RngExt;
use rand_distr::{Distribution, StandardNormal, StudentT};
use rand_pcg::Pcg64Mcg;
use vigil_blocks::SensorFrame;
use vigil_robot::kinematics::wrap_angle;
use vigil_robot::{ChannelMap, Description};

use super::scenario::{Draw, Frames};

/// Factor on the noise of an outlier.
const OUTLIER: f64 = 10.0;
/// Mean time between bursts of loss unless it is given, s.
const BURST_EACH_S: f64 = 20.0;
/// No two instants of capture are closer than so much of a period.
const APART_MIN: f64 = 0.05;

/// The numbers drawn for one run.
#[derive(Debug, Clone, Copy, Default)]
struct Drawn {
    loss: f64,
    burst_s: f64,
    burst_each_s: f64,
    jitter: f64,
    stamp_jitter: f64,
    late: f64,
    overtaken: f64,
    doubled: f64,
    /// Factors on the noise of x, y, yaw.
    pose: [f64; 3],
    encoder: f64,
    outliers: f64,
    student: Option<f64>,
    yaw_drift_rad_s: f64,
    pose_scale: f64,
}

/// What happens to one frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Fate {
    /// It comes.
    Comes,
    /// It never comes.
    Lost,
    /// It comes after every stage has missed it.
    Late,
    /// It comes after its successor.
    Overtaken,
    /// It comes twice.
    Doubled,
}

impl Fate {
    /// Calls `take` with what arrives in place of `frame`, none for one that is missed; `held` is
    /// one that this one has overtaken.
    pub fn deliver(
        self,
        frame: &SensorFrame,
        held: Option<&SensorFrame>,
        take: &mut dyn FnMut(Option<&SensorFrame>),
    ) {
        match self {
            Self::Lost | Self::Overtaken => take(None),
            Self::Late => {
                take(None);
                take(Some(frame));
            }
            Self::Comes | Self::Doubled => take(Some(frame)),
        }
        if held.is_some() {
            take(held);
        }
        if self == Self::Doubled {
            take(Some(frame));
        }
    }
}

/// The way of the frames of one run.
#[derive(Debug, Clone)]
pub struct Way {
    drawn: Drawn,
    gaps_s: Vec<[f64; 2]>,
    period_s: f64,
    /// Standard deviations of the world's noise at this rate: position m, yaw rad, rate rad/s.
    noise: [f64; 3],
    wheels: usize,
    map: ChannelMap,
    /// The one encoder with noise of its own.
    encoder: usize,
    burst_until_s: f64,
    odometry: Option<[f64; 3]>,
    true_before: [f64; 3],
    yaw_error_rad: f64,
    rng: Pcg64Mcg,
}

/// What differs between the runs of a scenario.
#[derive(Debug, Clone, Copy)]
pub struct RunConditions {
    /// Number of the run, from 0.
    pub run: usize,
    /// Rate of the frames, Hz.
    pub rate_hz: f64,
    /// Factor on the world's noise.
    pub noise: f64,
    /// How much later gaps are, s.
    pub later_s: f64,
}

impl std::fmt::Display for Way {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{:?}", self.drawn)
    }
}

impl Way {
    /// The way of a run's frames.
    pub fn new(
        frames: &Frames,
        robot: &Description,
        conditions: RunConditions,
        mut rng: Pcg64Mcg,
    ) -> Self {
        let RunConditions {
            run,
            rate_hz,
            noise,
            later_s,
        } = conditions;
        let mut of = |draw: &Option<Draw>, otherwise: f64| {
            draw.as_ref()
                .map_or(otherwise, |draw| draw.sample(run, &mut rng))
        };
        let drawn = Drawn {
            loss: of(&frames.loss, 0.0),
            burst_s: of(&frames.burst_s, 0.0),
            burst_each_s: of(&frames.burst_each_s, BURST_EACH_S),
            jitter: of(&frames.jitter, 0.0),
            stamp_jitter: of(&frames.stamp_jitter, 0.0),
            late: of(&frames.late, 0.0),
            overtaken: of(&frames.overtaken, 0.0),
            doubled: of(&frames.doubled, 0.0),
            pose: [
                of(&frames.noise_x, 1.0),
                of(&frames.noise_y, 1.0),
                of(&frames.noise_yaw, 1.0),
            ],
            encoder: of(&frames.noise_encoder, 1.0),
            outliers: of(&frames.outliers, 0.0),
            student: frames.student.as_ref().map(|_| of(&frames.student, 3.0)),
            yaw_drift_rad_s: of(&frames.yaw_drift_rad_s, 0.0),
            pose_scale: of(&frames.pose_scale, 1.0),
        };
        let factor = noise * (rate_hz / robot.noise.reference_rate_hz).sqrt();
        let drifts = drawn.yaw_drift_rad_s != 0.0 || drawn.pose_scale != 1.0;
        Self {
            drawn,
            gaps_s: frames
                .gaps_s
                .iter()
                .map(|gap| gap.map(|t_s| t_s + later_s))
                .collect(),
            period_s: 1.0 / rate_hz,
            noise: [
                factor * robot.noise.position_m,
                factor * robot.noise.yaw_rad,
                factor * robot.noise.wheel_rate_rad_s,
            ],
            wheels: robot.wheels.len(),
            map: ChannelMap::new(robot),
            encoder: run % robot.wheels.len().max(1),
            burst_until_s: f64::NEG_INFINITY,
            odometry: drifts.then_some([0.0; 3]),
            true_before: [0.0; 3],
            yaw_error_rad: 0.0,
            rng,
        }
    }

    /// Factor on the noise that the world itself adds: none where all noise is added here.
    pub const fn world_noise(frames: &Frames, noise: f64) -> f64 {
        if frames.student.is_some() { 0.0 } else { noise }
    }

    /// The instant of the next capture after `t_s`, for the regular instant `due_s`.
    pub fn instant_s(&mut self, t_s: f64, due_s: f64) -> f64 {
        let off = self.drawn.jitter * self.period_s;
        let at_s = due_s
            + if off > 0.0 {
                self.rng.random_range(-off..off)
            } else {
                0.0
            };
        at_s.max(t_s + APART_MIN * self.period_s)
    }

    /// The stamp of a frame captured at `t_s`.
    pub fn stamp_s(&mut self, t_s: f64) -> f64 {
        let off = self.drawn.stamp_jitter * self.period_s;
        t_s + if off > 0.0 {
            self.rng.random_range(-off..off)
        } else {
            0.0
        }
    }

    /// What happens to the frame of `t_s`.
    pub fn fate(&mut self, t_s: f64) -> Fate {
        let Drawn {
            loss,
            burst_s,
            burst_each_s,
            ..
        } = self.drawn;
        if burst_s > 0.0 && t_s > self.burst_until_s {
            let begins = self.rng.random::<f64>() < self.period_s / burst_each_s;
            self.burst_until_s = if begins {
                t_s + burst_s
            } else {
                self.burst_until_s
            };
        }
        let in_gap = self
            .gaps_s
            .iter()
            .any(|gap| (gap[0]..gap[1]).contains(&t_s));
        if in_gap || t_s < self.burst_until_s {
            return Fate::Lost;
        }
        let mut share = |share: f64| share > 0.0 && self.rng.random::<f64>() < share;
        match self.drawn {
            _ if share(loss) => Fate::Lost,
            drawn if share(drawn.late) => Fate::Late,
            drawn if share(drawn.overtaken) => Fate::Overtaken,
            drawn if share(drawn.doubled) => Fate::Doubled,
            _ => Fate::Comes,
        }
    }

    /// Puts noise and drift on a frame; the true pose is that of its capture, `dt_s` after the last
    /// one.
    pub fn blur(&mut self, frame: &mut SensorFrame, pose: [f64; 3], dt_s: f64) {
        let drifted = self.drift(pose, dt_s);
        let [position_m, yaw_rad, rate_rad_s] = self.noise;
        if let Some(mut measured) = self.map.pose(frame) {
            for (axis, scale) in [position_m, position_m, yaw_rad].into_iter().enumerate() {
                measured[axis] += drifted.map_or(0.0, |at| at[axis] - pose[axis]);
                measured[axis] += self.noise(scale, self.drawn.pose[axis]);
            }
            measured[2] = wrap_angle(measured[2]);
            self.map.set_pose(frame, measured);
        }
        for wheel in 0..self.wheels {
            let own = wheel == self.encoder;
            let factor = if own { self.drawn.encoder } else { 1.0 };
            let noise = self.noise(rate_rad_s, factor);
            if let Some(rate) = self.map.wheel_rate(frame, wheel) {
                self.map.set_wheel_rate(frame, wheel, rate + noise);
            }
        }
    }

    /// Noise beyond the world's own of this deviation, for a factor on it.
    fn noise(&mut self, deviation: f64, factor: f64) -> f64 {
        let rng = &mut self.rng;
        let mut unit = || -> f64 { StandardNormal.sample(rng) };
        if let Some(freedom) = self.drawn.student {
            let scale = ((freedom - 2.0) / freedom).max(0.0).sqrt() * factor * deviation;
            return StudentT::new(freedom).map_or(0.0, |t| scale * t.sample(&mut self.rng));
        }
        let mut more = 0.0;
        // Variances add up: what is missing to the factor.
        if factor > 1.0 {
            more += (factor * factor - 1.0).sqrt() * deviation * unit();
        }
        if self.drawn.outliers > 0.0 && self.rng.random::<f64>() < self.drawn.outliers {
            let unit: f64 = StandardNormal.sample(&mut self.rng);
            more += (OUTLIER * OUTLIER - 1.0).sqrt() * deviation * unit;
        }
        more
    }

    /// Where an odometry believes the robot that is truly at `pose`.
    fn drift(&mut self, pose: [f64; 3], dt_s: f64) -> Option<[f64; 3]> {
        let at = self.odometry.as_mut()?;
        let way = [pose[0] - self.true_before[0], pose[1] - self.true_before[1]];
        let (sin, cos) = self.yaw_error_rad.sin_cos();
        at[0] += self.drawn.pose_scale * (cos * way[0] - sin * way[1]);
        at[1] += self.drawn.pose_scale * (sin * way[0] + cos * way[1]);
        self.yaw_error_rad += self.drawn.yaw_drift_rad_s * dt_s;
        at[2] = pose[2] + self.yaw_error_rad;
        self.true_before = pose;
        Some(*at)
    }
}
