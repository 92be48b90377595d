//! What several stuck wheels do together, of which nothing was learned.
//!
//! More than the sum of what each does alone: fewer wheels drive against more drag, until from
//! three or four on the robot hardly moves. By how much more, and how much the soil changes that,
//! is what the equilibrium of forces ([`crate::slip`]) says; what each wheel does alone stays as
//! learned, and so does how uneven the ground is.

use nalgebra::{Matrix3, SMatrix, SVector, Vector3};
use vigil_blocks::WHEELS;
use vigil_inference::track::MotionNoise;

use super::{Curve, Model, MotionModel, RateModel};
use crate::description::Description;
use crate::kinematics::ROVER_WHEELS;
use crate::slip::{Condition, IMMOBILE_STUCK, Situation, SlipModel, Soil, Unknowns};

/// Curvatures, relative to the largest learned, at which the equilibrium is solved. Chosen: two
/// more than a curve of the fourth order has coefficients. Each costs the start solutions.
const TURNS: [f64; 7] = [-1.0, -0.67, -0.33, 0.0, 0.33, 0.67, 1.0];
/// Those of them at which it is solved on other soils too.
const TURNS_NOISE: [usize; 3] = [1, 3, 5];
/// Speeds at which it is: the ends of the learned range and their middle.
const SPEEDS: usize = 3;
const NODES: usize = TURNS.len() * SPEEDS;
/// Terms of a wheel's droop: powers 0 to 2 of the curvature.
const DROOP: usize = 3;
/// Soils that the robot may drive on, relative to the described ground: friction, shear modulus.
/// Two pairs, each one deviation up and one down. Chosen: a quarter of the friction, two thirds of
/// the modulus.
const SOILS: [(f64, f64); 4] = [(0.8, 1.0), (1.25, 1.0), (1.0, 0.6), (1.0, 1.7)];
/// Change of the friction under one wheel by which its effect is found, relative. A difference
/// quotient: the step divides out.
const FRICTION_STEP: f64 = 0.08;
/// Deviation of the motion per metre that nothing here explains: yaw, forward, lateral. Chosen: a
/// fifth to a twelfth of the unknown's.
const FLOOR_SD: [f64; 3] = [0.05, 0.03, 0.01];

type Nodes = SVector<f64, NODES>;

/// What is solved for at the nodes: yaw, forward and lateral motion per commanded metre; the
/// wheels' rates, rad/s.
#[derive(Debug, Clone, Copy)]
struct Equilibrium {
    motion: [Nodes; 3],
    rates: [Nodes; WHEELS],
}

/// How the robot moves while several wheels are stuck.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Several {
    /// Its motion.
    pub motion: MotionModel,
    /// The motion's noise.
    pub noise: MotionNoise,
    /// How the turning wheels' rates change beyond the sum of what each stuck wheel does to them;
    /// in all if the robot is immobile.
    pub beyond: [RateModel; WHEELS],
}

/// The equilibria of one robot.
#[derive(Debug, Clone)]
pub(super) struct Together<'a> {
    model: &'a Model,
    slip: SlipModel,
    /// Curvature (1/m) and speed (m/s) of each node.
    nodes: [(f64, f64); NODES],
    nominal: Equilibrium,
    alone: [Option<Equilibrium>; WHEELS],
    /// Variance of the friction from place to place, relative to that of [`FRICTION_STEP`].
    unevenness: f64,
    to_curve: SMatrix<f64, { Curve::TERMS }, NODES>,
    to_droop: SMatrix<f64, DROOP, NODES>,
}

impl<'a> Together<'a> {
    /// The equilibria over what the model has learned from; `None` for a robot that is no
    /// rocker-bogie rover.
    pub fn new(model: &'a Model, robot: &Description) -> Option<Self> {
        let slip = SlipModel::new(robot).ok()?;
        let limit = model.command.curvature_max_1_m;
        let [slow, fast] = model.command.speed_range_m_s;
        let nodes: [(f64, f64); NODES] = std::array::from_fn(|node| {
            let share = (node % SPEEDS) as f64 / (SPEEDS - 1) as f64;
            (limit * TURNS[node / SPEEDS], slow + share * (fast - slow))
        });
        let curve = SMatrix::from_fn(|node, term| {
            let (curvature, speed) = nodes[node];
            Curve::basis(curvature, speed)[term]
        });
        let droop = SMatrix::from_fn(|node, term| nodes[node].0.powi(term as i32));
        let mut together = Self {
            nominal: equilibrium(&slip, &nodes, 0)?,
            alone: std::array::from_fn(|wheel| equilibrium(&slip, &nodes, 1 << wheel)),
            unevenness: 1.0,
            to_curve: least_squares(&curve)?,
            to_droop: least_squares(&droop)?,
            model,
            slip,
            nodes,
        };
        let (mut learned, mut expected) = (0.0, 0.0);
        for wheel in 0..ROVER_WHEELS {
            if let Some(stuck) = model.stuck(wheel) {
                learned += stuck.motion.noise().deviation.trace();
                expected += together.of_uneven_ground(1 << wheel)?.trace();
            }
        }
        together.unevenness = learned / expected;
        Some(together)
    }

    /// How the robot moves while the wheels `stuck` (bits) are stuck; `None` where there is no
    /// equilibrium.
    pub fn several(&self, stuck: u32) -> Option<Several> {
        let Equilibrium { motion, rates } = equilibrium(&self.slip, &self.nodes, stuck)?;
        let mut beyond = Equilibrium {
            motion: std::array::from_fn(|axis| motion[axis] - self.nominal.motion[axis]),
            rates: std::array::from_fn(|wheel| rates[wheel] - self.nominal.rates[wheel]),
        };
        // Effects of single wheels add up only while the robot moves. Of an immobile one everything
        // is `beyond`.
        let counted = if is_immobile(stuck) { 0 } else { stuck };
        for wheel in (0..WHEELS).filter(|&wheel| counted >> wheel & 1 == 1) {
            let alone = self.alone[wheel].as_ref()?;
            for (sum, (with, without)) in side_by_side(&mut beyond, alone, &self.nominal) {
                *sum -= with - without;
            }
        }
        Some(Several {
            motion: self.motion(stuck, &beyond)?,
            noise: self.noise(stuck)?,
            beyond: beyond.rates.map(|at_nodes| RateModel {
                droop_rad_s: (self.to_droop * -at_nodes).into(),
                ..RateModel::NONE
            }),
        })
    }

    /// Nominal motion, and what each wheel changes of it, and they beyond that.
    fn motion(&self, stuck: u32, beyond: &Equilibrium) -> Option<MotionModel> {
        let nominal = &self.model.nominal.motion;
        let mut motion = *nominal;
        if is_immobile(stuck) {
            [motion.yaw, motion.forward, motion.lateral] = [Curve::default(); 3];
            return Some(motion);
        }
        let [yaw, forward, lateral] = beyond
            .motion
            .map(|at_nodes| Curve::from_terms((self.to_curve * at_nodes).into()));
        motion.yaw = plus(&motion.yaw, &yaw, &Curve::default());
        motion.forward = plus(&motion.forward, &forward, &Curve::default());
        motion.lateral = plus(&motion.lateral, &lateral, &Curve::default());
        for wheel in (0..WHEELS).filter(|&wheel| stuck >> wheel & 1 == 1) {
            let with = &self.model.stuck(wheel)?.motion;
            motion.yaw = plus(&motion.yaw, &with.yaw, &nominal.yaw);
            motion.forward = plus(&motion.forward, &with.forward, &nominal.forward);
            motion.lateral = plus(&motion.lateral, &with.lateral, &nominal.lateral);
        }
        Some(motion)
    }

    /// The soil is unknown, and uneven. A robot that hardly moves stays where it is on it: what is
    /// uneven is constant too.
    fn noise(&self, stuck: u32) -> Option<MotionNoise> {
        let floor = Vector3::from(FLOOR_SD.map(|sd| sd * sd));
        let uneven = self.of_uneven_ground(stuck)? * self.unevenness;
        let soils = SOILS.map(|(friction, modulus)| {
            let soil = self.slip.soil();
            Soil::uniform(soil.friction[0] * friction, soil.shear_modulus * modulus)
        });
        let alone = self.model.stuck.iter().map(|stuck| stuck.motion.noise());
        let nominal = self.model.nominal.motion.noise();
        Some(MotionNoise {
            offset: Matrix3::from_diagonal(&floor) + uneven + self.of_soils(stuck, &soils)? * 0.5,
            deviation: nominal.deviation + uneven,
            length_m: alone.fold(nominal.length_m, |length_m, alone| {
                length_m.max(alone.length_m)
            }),
            white: nominal.white,
            drift: nominal.drift,
            bound: nominal.bound,
            changes_1_m: 0.0,
        })
    }

    /// Covariance of the motion per metre by friction that differs from wheel to wheel.
    fn of_uneven_ground(&self, stuck: u32) -> Option<Matrix3<f64>> {
        let soils: [Soil; ROVER_WHEELS] = std::array::from_fn(|wheel| {
            let mut soil = self.slip.soil();
            soil.friction[wheel] *= 1.0 + FRICTION_STEP;
            soil
        });
        self.of_soils(stuck, &soils)
    }

    /// Sum over these soils of the squared change of the motion per metre, mean over curvatures.
    fn of_soils(&self, stuck: u32, soils: &[Soil]) -> Option<Matrix3<f64>> {
        let mut sum = Matrix3::zeros();
        for turn in TURNS_NOISE {
            let (curvature, speed) = self.nodes[turn * SPEEDS + SPEEDS / 2];
            let (reference, _, start) =
                solve(&self.slip, curvature, speed, stuck, self.slip.soil(), None)?;
            for soil in soils {
                let (motion, ..) = solve(&self.slip, curvature, speed, stuck, *soil, Some(&start))?;
                let change = motion - reference;
                sum += change * change.transpose();
            }
        }
        Some(sum / TURNS_NOISE.len() as f64)
    }
}

/// True if these stuck wheels (bits) are too many for the robot to move.
pub(super) const fn is_immobile(stuck: u32) -> bool {
    stuck.count_ones() as usize >= IMMOBILE_STUCK
}

/// `base + with - without`.
pub(super) fn plus(base: &Curve, with: &Curve, without: &Curve) -> Curve {
    let (base, with, without) = (base.terms(), with.terms(), without.terms());
    Curve::from_terms(std::array::from_fn(|i| base[i] + with[i] - without[i]))
}

/// The quantities of three equilibria.
fn side_by_side<'a>(
    sum: &'a mut Equilibrium,
    with: &'a Equilibrium,
    without: &'a Equilibrium,
) -> impl Iterator<Item = (&'a mut Nodes, (&'a Nodes, &'a Nodes))> {
    let sums = sum.motion.iter_mut().chain(&mut sum.rates);
    let with = with.motion.iter().chain(&with.rates);
    sums.zip(with.zip(without.motion.iter().chain(&without.rates)))
}

/// The described ground at all nodes.
fn equilibrium(slip: &SlipModel, nodes: &[(f64, f64); NODES], stuck: u32) -> Option<Equilibrium> {
    let mut found = Equilibrium {
        motion: [SVector::zeros(); 3],
        rates: [SVector::zeros(); WHEELS],
    };
    for (index, &(curvature, speed)) in nodes.iter().enumerate() {
        let (motion, rates, _) = solve(slip, curvature, speed, stuck, slip.soil(), None)?;
        for (at_nodes, value) in found.motion.iter_mut().zip(&motion) {
            at_nodes[index] = *value;
        }
        for (at_nodes, value) in found.rates.iter_mut().zip(rates) {
            at_nodes[index] = value;
        }
    }
    Some(found)
}

/// Yaw, forward and lateral motion per metre, the wheels' rates, and where to start the next.
fn solve(
    slip: &SlipModel,
    curvature_1_m: f64,
    speed_m_s: f64,
    stuck: u32,
    soil: Soil,
    start: Option<&Unknowns>,
) -> Option<(Vector3<f64>, [f64; ROVER_WHEELS], Unknowns)> {
    let situation = Situation {
        curvature_1_m,
        speed_m_s,
        stuck: std::array::from_fn(|wheel| stuck >> wheel & 1 == 1),
        soil,
        condition: Condition::default(),
    };
    let solution = slip.solve(&situation, start).ok()?;
    let [forward, lateral, yaw] = solution.velocity;
    let motion = Vector3::new(yaw, forward, lateral) / speed_m_s;
    Some((motion, solution.wheel_rate_rad_s, solution.unknowns()))
}

/// The matrix that takes values at the nodes to coefficients of the least sum of squares.
fn least_squares<const TERMS: usize>(
    basis: &SMatrix<f64, NODES, TERMS>,
) -> Option<SMatrix<f64, TERMS, NODES>> {
    let normal = basis.tr_mul(basis).cholesky()?;
    Some(normal.solve(&basis.transpose()))
}
