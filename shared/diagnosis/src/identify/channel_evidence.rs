//! The evidence of each channel for a diagnosis against the next best explanation.
//!
//! When a diagnosis is made, it and its rival are both followed from the onset on, each as if it
//! alone were true, and the log-likelihoods of the measurements are summed by channel. The filter's
//! own hypotheses do not hold these sums: the second best has usually branched off the best a
//! moment ago and shares its past.

use vigil_blocks::{EVIDENCE, MODE_MULTIPLE, MODE_UNKNOWN, WHEELS};
use vigil_checkpoint::{Checkpoint, CheckpointValue};
use vigil_inference::alternative::Alternatives;
use vigil_inference::logspace::log_add;
use vigil_inference::outlier::unvouched;
use vigil_inference::track::Track;
use vigil_robot::learned::steer_reading::ANYTHING;
use vigil_robot::learned::wheels::steering_angle;
use vigil_robot::learned::{
    Healthy, Model, MotionMode, Mover, NoiseScales, Observation, WheelContext, WheelEvidence,
};
use vigil_robot::slot::{SLOTS, Slot};
use vigil_robot::{ChannelMap, Description};

use crate::identify::angles::Angles;
use crate::identify::leaf_map::LeafMap;
use crate::identify::rate_offsets::RateOffsets;
use crate::identify::servo_fault::{ServoFault, ServoPrior};
use crate::identify::tree_belief::TreeBelief;
use crate::identify::wheel_update::is_new;

/// Probability, per observation, that in the unknown a wheel or an angle begins or ceases to do
/// anything. Chosen by hand: once in 1.4 h of 50 ms, so that within one fault it moves no evidence.
const CHANGES: f64 = 1e-5;

/// What a diagnosis may say.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Explanation {
    /// Exactly this set of leaves.
    Leaves(u64),
    /// No modelled fault.
    Unknown,
}

/// An explanation that is taken to be true since the onset.
#[derive(Debug, Clone, Copy, PartialEq, CheckpointValue)]
struct FollowedExplanation {
    /// Index of the motion mode.
    mode: usize,
    /// Wheels whose encoders are broken, as bits.
    broken: u32,
    track: Track,
    offsets: RateOffsets,
    servo: Option<ServoFault>,
    /// In the unknown: which wheels and which angles do anything.
    anything: [Alternatives<2>; WHEELS],
    angles: Angles,
    /// Log-likelihood of the readings, by channel.
    log_likelihood: [f64; SLOTS],
}

/// How the robot drives at an instant.
#[derive(Debug, Clone, Copy)]
pub struct Drive {
    /// Curvature that the body follows, 1/m.
    pub curvature_1_m: f64,
    /// Its speed, m/s.
    pub speed_m_s: f64,
    /// Commanded curvature, 1/m.
    pub commanded_1_m: f64,
}

/// The diagnosis and its rival.
#[derive(Debug, Clone, Checkpoint)]
pub struct ChannelEvidence {
    #[checkpoint(fixed)]
    model: Model,
    #[checkpoint(fixed)]
    robot: Description,
    #[checkpoint(fixed)]
    map: ChannelMap,
    #[checkpoint(fixed)]
    modes: Vec<MotionMode>,
    use_wheels: bool,
    #[checkpoint(fixed)]
    servo: ServoPrior,
    /// Of the wheels, from before the onset.
    wheels: WheelContext,
    followed: Option<[FollowedExplanation; 2]>,
    onset_ns: u64,
    runner_up: u32,
}

impl ChannelEvidence {
    /// No diagnosis yet, of a robot that may move in these ways.
    #[must_use]
    pub fn new(
        model: &Model,
        robot: &Description,
        modes: Vec<MotionMode>,
        use_wheels: bool,
    ) -> Self {
        Self {
            model: model.clone(),
            robot: robot.clone(),
            map: ChannelMap::new(robot),
            modes,
            use_wheels,
            servo: ServoPrior::new(robot),
            wheels: WheelContext::default(),
            followed: None,
            onset_ns: 0,
            runner_up: 0,
        }
    }

    /// Forgets the diagnosis.
    pub fn clear(&mut self) {
        (self.followed, self.runner_up) = (None, 0);
    }

    /// The next best when the diagnosis was made: a node, unknown or multiple, as
    /// `FaultBelief::mode`.
    #[must_use]
    pub const fn runner_up(&self) -> u32 {
        self.runner_up
    }

    /// Where the robot's channels lie in its frames.
    pub const fn map(&self) -> &ChannelMap {
        &self.map
    }

    /// By channel: how much more the readings since the onset are expected under the diagnosis than
    /// under its rival, natural log-likelihood.
    #[must_use]
    pub fn channel_evidence(&self) -> [f64; EVIDENCE] {
        let slots = self.followed.map_or([0.0; SLOTS], |[named, rival]| {
            std::array::from_fn(|i| {
                let ratio = named.log_likelihood[i] - rival.log_likelihood[i];
                if ratio.is_finite() { ratio } else { 0.0 }
            })
        });
        self.map.to_evidence(&slots, 0.0)
    }

    /// Begins to follow the diagnosis of `posterior` and its rival from before `onset_ns`, while
    /// the robot drives like this.
    pub fn begin(
        &mut self,
        posterior: &TreeBelief,
        leaves: &LeafMap,
        healthy: &Healthy,
        drive: Drive,
        onset_ns: u64,
    ) {
        let (named, rival) = contenders(posterior);
        self.runner_up = match rival {
            Explanation::Unknown => MODE_UNKNOWN,
            Explanation::Leaves(0) => 0,
            Explanation::Leaves(set) if set.count_ones() > 1 => MODE_MULTIPLE,
            Explanation::Leaves(set) => set.trailing_zeros(),
        };
        (self.onset_ns, self.wheels) = (onset_ns, healthy.wheels);
        let lineage = |explanation| {
            let (moved, broken) = match explanation {
                Explanation::Unknown => (Mover::UnknownAny, 0),
                Explanation::Leaves(set) => {
                    let (stuck, askew) = (wheels(&leaves.stuck, set), wheels(&leaves.steer, set));
                    let jumped = leaves.pose.is_some_and(|pose| set >> pose & 1 == 1);
                    let moved = match (stuck, askew) {
                        (0, 0) if jumped => Mover::Pose,
                        (0, 0) => Mover::Nominal,
                        (0, askew) => Mover::Steer(askew.trailing_zeros() as usize),
                        (stuck, _) => Mover::Stuck(stuck),
                    };
                    (moved, wheels(&leaves.encoder, set))
                }
            };
            let mode = self.modes.iter().position(|mode| mode.moved == moved)?;
            let noise =
                self.modes[mode].noise_at(&self.model, drive.curvature_1_m, drive.speed_m_s);
            Some(FollowedExplanation {
                mode,
                broken,
                track: healthy.track(&noise),
                offsets: RateOffsets::default(),
                servo: match moved {
                    Mover::Steer(wheel) => {
                        let angle = steering_angle(&self.robot, wheel, drive.commanded_1_m);
                        Some(ServoFault::new(&self.servo, angle))
                    }
                    _ => None,
                },
                anything: [Alternatives::new([1.0 - ANYTHING, ANYTHING]); WHEELS],
                angles: Angles::default(),
                log_likelihood: [0.0; SLOTS],
            })
        };
        self.followed = lineage(named).zip(lineage(rival)).map(<[_; 2]>::from);
    }

    /// Takes the next observation.
    pub fn follow(&mut self, observation: &Observation, noise: NoiseScales) {
        let Some(mut followed) = self.followed else {
            return;
        };
        self.wheels.fade(observation.travel_m);
        let variance = observation.pose_variance(&self.model, noise.pose);
        for FollowedExplanation { mode, track, .. } in &mut followed {
            let mode = &self.modes[*mode];
            if !observation.anchor {
                let step = observation.displacement(&self.model, &mode.motion);
                track.predict(&step, &mode.noise);
            } else if observation.pose_frames > 0 {
                track.anchor(observation.pose, unvouched(variance));
            }
        }
        if observation.moving && !observation.anchor {
            if self.use_wheels {
                self.take_wheels(&mut followed, observation, noise);
            }
            if observation.pose_frames > 0 {
                for FollowedExplanation {
                    track,
                    log_likelihood,
                    ..
                } in &mut followed
                {
                    let gained = track.update(observation.pose, variance);
                    log_likelihood[Slot::POSE] += gained.unwrap_or(0.0);
                }
            }
        }
        self.followed = Some(followed);
    }

    fn take_wheels(
        &self,
        followed: &mut [FollowedExplanation; 2],
        observation: &Observation,
        noise: NoiseScales,
    ) {
        let (model, robot) = (&self.model, &self.robot);
        let evidence = WheelEvidence::new(model, robot, observation, noise, &self.wheels);
        let is_new = is_new(observation.t_ns, self.onset_ns);
        for lineage in followed {
            let mode = &self.modes[lineage.mode];
            let moved = mode.moved;
            for wheel in 0..self.robot.wheels.len().min(WHEELS) {
                let is_broken = lineage.broken >> wheel & 1 == 1;
                lineage.log_likelihood[Slot::wheel_rate(wheel)] += if is_broken {
                    // In any way, or by a size: then it reads a smooth rate of its own. Half each.
                    let ways = [evidence.broken_anyhow(wheel), evidence.own_rate[wheel]];
                    log_add(ways[0], ways[1]) - std::f64::consts::LN_2
                } else if moved == Mover::UnknownAny {
                    // As a healthy wheel or anything: the odds of both, over the first.
                    let healthy = evidence.healthy[wheel];
                    let ratio = evidence.any[wheel] - healthy;
                    healthy + lineage.anything[wheel].step([0.0, ratio], [CHANGES; 2])
                } else if mode.learns_rate(wheel) && !is_new {
                    let dragged = evidence.dragged(&self.model, observation, mode, wheel);
                    let (model, offsets) = (&self.model, &mut lineage.offsets);
                    let log_likelihood =
                        offsets.log_likelihood(model, observation, &evidence, wheel, &dragged);
                    offsets.learn(observation, &evidence, wheel, &dragged);
                    log_likelihood
                } else {
                    evidence.whole(&self.model, observation, mode, is_new, wheel)
                };
            }
            for (wheel, reading) in evidence.steer.iter().enumerate() {
                let Some(reading) = reading else { continue };
                lineage.log_likelihood[Slot::steer(wheel)] += match (moved, &mut lineage.servo) {
                    (Mover::UnknownAny, _) => lineage.angles.step_one(wheel, reading, CHANGES),
                    (Mover::Steer(askew), Some(servo)) if askew == wheel => {
                        servo.step(&self.servo, reading)
                    }
                    _ => 0.0,
                };
            }
        }
    }
}

/// The best explanation and the next best that is not the same faults and one more: those explain
/// nothing else.
fn contenders(posterior: &TreeBelief) -> (Explanation, Explanation) {
    let named = posterior.sets[0].leaves;
    let others = posterior.sets[1..posterior.set_count.max(1)].iter();
    let mut others = others.filter(|set| named == 0 || set.leaves & named != named);
    let rival = others.next().copied().unwrap_or_default();
    // With more than half the unknown is the diagnosis, and the named set its rival. With less it
    // is a rival like any set.
    if posterior.unknown > 0.5 {
        (Explanation::Unknown, Explanation::Leaves(named))
    } else if posterior.unknown > rival.p {
        (Explanation::Leaves(named), Explanation::Unknown)
    } else {
        (
            Explanation::Leaves(named),
            Explanation::Leaves(rival.leaves),
        )
    }
}

/// Wheels whose node is in a set, as bits.
fn wheels(nodes: &[Option<usize>; WHEELS], set: u64) -> u32 {
    let is_in = |node: &Option<usize>| node.is_some_and(|node| set >> node & 1 == 1);
    let wheels = nodes.iter().enumerate();
    wheels.fold(0, |bits, (wheel, node)| {
        bits | u32::from(is_in(node)) << wheel
    })
}
