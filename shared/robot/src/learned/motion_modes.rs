//! The ways in which a robot may move: nominal, wheels stuck, unknown.

use nalgebra::{Matrix3, Vector3};
use vigil_blocks::WHEELS;
use vigil_checkpoint::CheckpointValue;
use vigil_inference::track::MotionNoise;

use super::together::{Together, is_immobile};
use super::{Curve, Model, MotionModel, RateModel};
use crate::description::Description;

/// The unknown: standard deviation of its constant deviation per metre (yaw, forward, lateral).
/// Chosen: 1.5 and 2 times the learned effects of the rover's stuck wheels; aside, 0.6 of ahead.
const UNKNOWN_SD: [f64; 3] = [0.25, 0.2, 0.12];
/// Share of its variance by which it drifts per metre: what pulls in one direction of the ground
/// turns against the robot. Chosen: most of it within the length of a tolerance, 8 m.
const UNKNOWN_DRIFT_1_M: f64 = 0.1;
/// Share of the unknown that only makes the pose jump, and how far, in deviations of its noise: a
/// sensor that begins to lag, a slip of the map. Chosen: one unknown in ten, 2.3 nats; 0.1 m where
/// the noise is 5 mm.
const JUMP_SHARE: f64 = 0.1;
const JUMP_SD: f64 = 20.0;
/// Correlation length of the unknown's coloured deviations, m. Chosen: somewhat longer than that of
/// stuck wheels, 0.12 to 0.16 m.
const UNKNOWN_LENGTH_M: f64 = 0.2;
/// Factor by which a ground changes the learned effect of a stuck wheel.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct GroundFactor {
    /// Its mean.
    pub mean: f64,
    /// Its deviation.
    pub sd: f64,
}

impl GroundFactor {
    /// Ground like that learned from.
    pub const LEARNED: Self = Self { mean: 1.0, sd: 0.0 };
}

/// Ground not learned from. Chosen: a fifth, of 0.1 to 2.2 times a stuck wheel's effect.
struct OtherGround {
    /// How probable.
    share: f64,
    /// What it makes of that effect.
    factor: GroundFactor,
    /// Whether a dragged wheel throws the robot: on hard ground it grips and slides.
    throws: bool,
}

const fn ground(share: f64, mean: f64, sd: f64, throws: bool) -> OtherGround {
    OtherGround {
        share,
        factor: GroundFactor { mean, sd },
        throws,
    }
}

/// By the pose alone: harder, somewhat harder, softer, and hard enough to throw the robot. Chosen
/// so that neighbours overlap within two deviations from none of the effect to twice.
const OTHER_GROUNDS: [OtherGround; 4] = [
    ground(0.08, 0.3, 0.12, false),
    ground(0.08, 0.65, 0.2, false),
    ground(0.04, 1.5, 0.35, false),
    ground(0.04, 0.6, 0.6, true),
];
/// Where the wheels' rates are read: these tell which wheel stands, and the motion only that it is
/// dragged, and not how. Chosen: from none of the effect to nearly twice.
const ANY_GROUND: [OtherGround; 1] = [ground(0.2, 0.6, 0.6, true)];
/// Deviations of such motion beside its effect, coloured: yaw, forward, lateral. Chosen: about half
/// of the unknown's.
const ROUGH_SD: [f64; 3] = [0.15, 0.1, 0.05];
/// By the pose alone, a wheel stuck on other ground looks like one that is dragged at, has sunk in
/// or lost its tyre: how probable these are, given either. Chosen: a stuck wheel stays likelier ..
const DRAGGED_AT: f64 = 0.25;
/// .. and what one wheel does on one ground, another wheel of its side does on another. Chosen:
/// with [`DRAGGED_AT`] below half is left for the wheel, so that the side is named.
const P_ALIKE: f64 = 0.4;
/// Deviation of such an effect from one that is changed as a whole: yaw, forward, lateral. Chosen:
/// aside it is small and known worst.
const SHAPE: [f64; 3] = [0.1, 0.1, 0.5];

/// What moves the robot.
#[derive(Debug, Clone, Copy, PartialEq, Eq, CheckpointValue)]
pub enum Mover {
    /// All wheels as commanded.
    Nominal,
    /// These wheels are stuck: bit w is wheel w.
    Stuck(u32),
    /// This wheel's steering servo does not do as it is told, and moves the robot somehow.
    Steer(usize),
    /// The pose has jumped; the robot moves as commanded.
    Pose,
    /// A large constant deviation; wheels turn as commanded.
    Unknown,
    /// A large constant deviation; wheels and steering may do anything.
    UnknownAny,
}

impl Mover {
    /// True if `wheel` is stuck.
    #[must_use]
    pub const fn is_stuck(self, wheel: usize) -> bool {
        matches!(self, Self::Stuck(mask) if mask >> wheel & 1 == 1)
    }

    /// True for both kinds of unknown.
    #[must_use]
    pub const fn is_unknown(self) -> bool {
        matches!(self, Self::Unknown | Self::UnknownAny)
    }

    /// True if too many wheels are stuck for the robot to move.
    #[must_use]
    pub const fn is_immobile(self) -> bool {
        is_immobile(self.stuck())
    }

    /// Bits of the stuck wheels.
    #[must_use]
    pub const fn stuck(self) -> u32 {
        match self {
            Self::Stuck(mask) => mask,
            _ => 0,
        }
    }
}

/// One way to move.
#[derive(Debug, Clone, PartialEq)]
pub struct MotionMode {
    /// What moves the robot.
    pub moved: Mover,
    /// Share of what moves the robot so that it does in this way.
    pub share: f64,
    /// Probability that something moves the robot in this way that no fault describes.
    pub p_unknown: f64,
    /// Probability that another wheel of the same side moves the robot so, where one does.
    pub p_alike: f64,
    /// Displacement per commanded metre.
    pub motion: MotionModel,
    /// Its noise.
    pub noise: MotionNoise,
    /// Factor by which the ground changes the learned effect.
    pub ground: GroundFactor,
    /// Change of forward speed that no ground changes, m/s.
    pub kept_m_s: f64,
    /// Variance of a jump of the pose (x, y, yaw) at the onset.
    pub jump: [f64; 3],
    /// Whether the robot is thrown now and then: a wheel that locks on hard ground grips and
    /// slides.
    pub is_thrown: bool,
    /// How the turning wheels' rates change beyond the sum of what each stuck wheel does to them;
    /// in all if the robot is immobile.
    pub beyond: [RateModel; WHEELS],
}

impl MotionMode {
    /// True if the robot moves as it should, from wherever its pose has jumped.
    #[must_use]
    pub fn is_nominal_motion(&self) -> bool {
        self.moved == Mover::Nominal || self.jump != [0.0; 3]
    }

    /// True if this wheel's rate is learned on the way: others drag, or it stands askew.
    #[must_use]
    pub fn learns_rate(&self, wheel: usize) -> bool {
        match self.moved {
            Mover::Stuck(_) => !self.moved.is_stuck(wheel),
            Mover::Steer(askew) => askew == wheel,
            _ => false,
        }
    }

    /// The noise with which this mode begins at a curvature (1/m) and speed (m/s): the run's offset
    /// also lies along the effect itself, as far as the ground is not known.
    #[must_use]
    pub fn noise_at(&self, model: &Model, curvature: f64, speed: f64) -> MotionNoise {
        let limit = model.command.curvature_max_1_m;
        let at = |motion: &MotionModel| Vector3::from(motion.per_metre(curvature, speed, limit));
        let GroundFactor { mean: factor, sd } = self.ground;
        if sd <= 0.0 {
            return self.noise;
        }
        let effect = at(&self.motion) - at(&model.nominal.motion);
        let shape = effect.component_mul(&Vector3::from(SHAPE));
        let kept = self.kept_m_s / speed.abs().max(Curve::SPEED_FLOOR_M_S);
        let along = (effect - Vector3::new(0.0, kept, 0.0)) * (sd / factor);
        MotionNoise {
            offset: self.noise.offset
                + along * along.transpose()
                + Matrix3::from_diagonal(&shape.component_mul(&shape)),
            ..self.noise
        }
    }
}

/// The ways in which a robot may move whose wheels `stuck` (bits) may stick: nominal first, then
/// single wheels, sets of several if the wheels' rates are `read`, and both kinds of unknown; if
/// `rare`, single wheels on other ground and a jump of the pose too.
#[must_use]
pub fn motion_modes(
    model: &Model,
    robot: &Description,
    stuck: u32,
    rare: bool,
    read: bool,
) -> Vec<MotionMode> {
    let grounds = match (rare, read) {
        (true, true) => ANY_GROUND.as_slice(),
        (true, false) => OTHER_GROUNDS.as_slice(),
        (false, _) => &[],
    };
    let learned = 1.0 - grounds.iter().map(|ground| ground.share).sum::<f64>();
    let nominal = model.nominal.motion;
    let mut modes = vec![MotionMode {
        moved: Mover::Nominal,
        share: 1.0,
        p_unknown: 0.0,
        p_alike: 0.0,
        motion: nominal,
        noise: nominal.noise(),
        ground: GroundFactor::LEARNED,
        kept_m_s: 0.0,
        jump: [0.0; 3],
        is_thrown: false,
        beyond: [RateModel::NONE; WHEELS],
    }];
    let known = |w: usize| stuck >> w & 1 == 1 && model.stuck(w).is_some();
    let wheels = || (0..WHEELS).filter(|&w| known(w));
    modes.extend(wheels().map(|w| MotionMode {
        share: learned,
        ..stuck_mode(model, w)
    }));
    for ground in grounds {
        modes.extend(wheels().map(|w| MotionMode {
            share: ground.share,
            p_unknown: if read { 0.0 } else { DRAGGED_AT },
            p_alike: if read { 0.0 } else { P_ALIKE },
            ..on_other_ground(model, robot, w, ground.factor, ground.throws)
        }));
    }
    if read {
        let known = wheels().fold(0, |bits, wheel| bits | 1 << wheel);
        modes.extend(several_modes(model, robot, known));
    }
    modes.push(MotionMode {
        share: 1.0 - JUMP_SHARE,
        ..drives_on(model, Mover::Unknown)
    });
    modes.push(drives_on(model, Mover::UnknownAny));
    if rare {
        modes.push(MotionMode {
            share: JUMP_SHARE,
            noise: nominal.noise(),
            jump: jump_sd(robot).map(|sd| sd * sd),
            ..drives_on(model, Mover::Unknown)
        });
    }
    modes
}

/// How the robot moves while a steering servo does not do as it is told, of these wheels (bits).
pub fn steer_modes(model: &Model, steered: u32) -> impl Iterator<Item = MotionMode> {
    let wheels = (0..WHEELS).filter(move |wheel| steered >> wheel & 1 == 1);
    wheels.map(|wheel| drives_on(model, Mover::Steer(wheel)))
}

/// Nominal motion with a large constant deviation.
fn drives_on(model: &Model, moved: Mover) -> MotionMode {
    MotionMode {
        moved,
        share: 1.0,
        p_unknown: if moved.is_unknown() { 1.0 } else { 0.0 },
        p_alike: 0.0,
        motion: model.nominal.motion,
        noise: unknown_noise(model),
        ground: GroundFactor::LEARNED,
        kept_m_s: 0.0,
        jump: [0.0; 3],
        is_thrown: false,
        beyond: [RateModel::NONE; WHEELS],
    }
}

/// Noise of nominal motion with a large constant deviation: what is not known about a fault.
#[must_use]
pub(crate) fn unknown_noise(model: &Model) -> MotionNoise {
    let nominal = model.nominal.motion.noise();
    // As coloured as the stuck modes: an unknown fault meets the same soil.
    let coloured = model.stuck.iter().map(|s| s.motion.noise().deviation);
    let count = model.stuck.len().max(1) as f64;
    let deviation = coloured.fold(Matrix3::zeros(), |sum, next| sum + next) / count;
    MotionNoise {
        offset: Matrix3::from_diagonal(&Vector3::from(UNKNOWN_SD.map(|sd| sd * sd))),
        deviation: Matrix3::from_diagonal(&deviation.diagonal()) + nominal.deviation,
        length_m: UNKNOWN_LENGTH_M,
        // Twice the deviation of nominal driving.
        white: nominal.white * 4.0,
        drift: Vector3::from(UNKNOWN_SD.map(|sd| UNKNOWN_DRIFT_1_M * sd * sd)),
        bound: nominal.bound,
        changes_1_m: 0.0,
    }
}

/// Deviations of a jump of the pose: x m, y m, yaw rad.
fn jump_sd(robot: &Description) -> [f64; 3] {
    let noise = &robot.noise;
    [noise.position_m, noise.position_m, noise.yaw_rad].map(|sd| JUMP_SD * sd)
}

/// One wheel stuck, as learned.
fn stuck_mode(model: &Model, wheel: usize) -> MotionMode {
    let motion = model
        .stuck(wheel)
        .map_or(model.nominal.motion, |stuck| stuck.motion);
    MotionMode {
        moved: Mover::Stuck(1 << wheel),
        share: 1.0,
        p_unknown: 0.0,
        p_alike: 0.0,
        motion,
        noise: motion.noise(),
        ground: GroundFactor::LEARNED,
        kept_m_s: 0.0,
        jump: [0.0; 3],
        is_thrown: false,
        beyond: [RateModel::NONE; WHEELS],
    }
}

/// All sets of two wheels and more among those known (bits); none without an equilibrium.
fn several_modes(model: &Model, robot: &Description, known: u32) -> Vec<MotionMode> {
    let Some(together) = Together::new(model, robot) else {
        return Vec::new();
    };
    let sets = (1..=known).filter(|set| set.count_ones() > 1 && set & !known == 0);
    sets.filter_map(|set| several_mode(&together, set))
        .collect()
}

/// Several wheels stuck.
fn several_mode(together: &Together<'_>, set: u32) -> Option<MotionMode> {
    let several = together.several(set)?;
    Some(MotionMode {
        share: 1.0,
        p_unknown: 0.0,
        p_alike: 0.0,
        moved: Mover::Stuck(set),
        motion: several.motion,
        noise: several.noise,
        ground: GroundFactor::LEARNED,
        kept_m_s: 0.0,
        jump: [0.0; 3],
        is_thrown: false,
        beyond: several.beyond,
    })
}

/// A wheel stuck on ground that changes its effect by one unknown factor: it is the shear of the
/// soil under the driven wheels that lets a dragged one slow and turn the robot. That the motors
/// turn slower under the load does not depend on the ground.
fn on_other_ground(
    model: &Model,
    robot: &Description,
    wheel: usize,
    ground: GroundFactor,
    is_thrown: bool,
) -> MotionMode {
    let nominal = &model.nominal.motion;
    let mode = stuck_mode(model, wheel);
    let GroundFactor { mean: factor, sd } = ground;
    let kept_m_s = yielding_m_s(model, robot, wheel);
    let scaled = |stuck: &Curve, nominal: &Curve, kept_m_s: f64| {
        let (stuck, nominal) = (stuck.terms(), nominal.terms());
        let kept = Curve::of_inverse_speed(kept_m_s).terms();
        Curve::from_terms(std::array::from_fn(|i| {
            nominal[i] + factor * (stuck[i] - nominal[i]) + (1.0 - factor) * kept[i]
        }))
    };
    let (square, healthy) = (factor * factor + sd * sd, nominal.noise());
    let diagonal = |sd: [f64; 3]| match is_thrown {
        true => Matrix3::from_diagonal(&Vector3::from(sd.map(|sd| sd * sd))),
        false => Matrix3::zeros(),
    };
    MotionMode {
        motion: MotionModel {
            yaw: scaled(&mode.motion.yaw, &nominal.yaw, 0.0),
            forward: scaled(&mode.motion.forward, &nominal.forward, kept_m_s),
            lateral: scaled(&mode.motion.lateral, &nominal.lateral, 0.0),
            ..mode.motion
        },
        noise: MotionNoise {
            offset: mode.noise.offset * square + healthy.offset + diagonal(UNKNOWN_SD),
            deviation: mode.noise.deviation * square + healthy.deviation + diagonal(ROUGH_SD),
            ..mode.noise
        },
        ground,
        kept_m_s,
        is_thrown,
        ..mode
    }
}

/// Change of forward speed, m/s, by the motors that yield while `wheel` drags: mean over the wheels
/// that turn, straight ahead.
fn yielding_m_s(model: &Model, robot: &Description, wheel: usize) -> f64 {
    let Some(stuck) = model.stuck(wheel) else {
        return 0.0;
    };
    let pairs = stuck.rates.iter().zip(&model.nominal.rates).enumerate();
    let turning = pairs.filter(|(other, _)| *other != wheel);
    let (count, sum) = turning.fold((0.0, 0.0), |(count, sum), (_, (with, healthy))| {
        (
            count + 1.0,
            sum + healthy.droop_rad_s[0] - with.droop_rad_s[0],
        )
    });
    if count > 0.0 {
        sum / count * robot.wheel_radius_m
    } else {
        0.0
    }
}
