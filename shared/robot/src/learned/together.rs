//! What several stuck wheels do together, of which nothing was learned.
//!
//! More than the sum of what each does alone: fewer wheels drive against more drag, until from
//! three or four on the robot hardly moves. By how much more is what the equilibrium of forces
//! ([`crate::slip`]) gives on its reference soil; what each does alone stays as learned.

use nalgebra::{SMatrix, SVector};
use vigil_blocks::WHEELS;

use super::{Curve, Model, RateModel};
use crate::Description;
use crate::slip::{Condition, Situation, SlipModel, Soil};

/// Curvatures, relative to the largest learned, at which the equilibrium is solved.
const TURNS: [f64; 7] = [-1.0, -0.67, -0.33, 0.0, 0.33, 0.67, 1.0];
/// Speeds at which it is: the ends of the learned range and their middle.
const SPEEDS: usize = 3;
const NODES: usize = TURNS.len() * SPEEDS;
/// Terms of a wheel's droop.
const DROOP: usize = 3;

/// What is solved for at the nodes: yaw, forward and lateral motion per commanded metre; the
/// wheels' rates, rad/s.
#[derive(Debug, Clone, Copy)]
struct Equilibrium {
    motion: [SVector<f64, NODES>; 3],
    rates: [SVector<f64, NODES>; WHEELS],
}

/// What a set of stuck wheels does beyond the sum of what each does alone.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Beyond {
    /// Of yaw, forward and lateral motion per commanded metre.
    pub motion: [Curve; 3],
    /// Of the turning wheels' rates.
    pub rates: [RateModel; WHEELS],
}

/// The equilibria of one robot.
#[derive(Debug, Clone)]
pub(super) struct Together {
    slip: SlipModel,
    /// Curvature (1/m) and speed (m/s) of each node.
    nodes: [(f64, f64); NODES],
    nominal: Equilibrium,
    alone: [Option<Equilibrium>; WHEELS],
    to_curve: SMatrix<f64, { Curve::TERMS }, NODES>,
    to_droop: SMatrix<f64, DROOP, NODES>,
}

impl Together {
    /// The equilibria over what the model has learned from; `None` for a robot that is no
    /// rocker-bogie rover of known mass.
    pub fn new(model: &Model, robot: &Description) -> Option<Self> {
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
        Some(Self {
            nominal: solve(&slip, &nodes, 0)?,
            alone: std::array::from_fn(|wheel| solve(&slip, &nodes, 1 << wheel)),
            to_curve: least_squares(&curve)?,
            to_droop: least_squares(&droop)?,
            slip,
            nodes,
        })
    }

    /// What the wheels `stuck` (bits) do beyond the sum; `None` where there is no equilibrium.
    pub fn beyond(&self, stuck: u32) -> Option<Beyond> {
        let Equilibrium { motion, rates } = solve(&self.slip, &self.nodes, stuck)?;
        let mut beyond = Equilibrium {
            motion: std::array::from_fn(|axis| motion[axis] - self.nominal.motion[axis]),
            rates: std::array::from_fn(|wheel| rates[wheel] - self.nominal.rates[wheel]),
        };
        for wheel in (0..WHEELS).filter(|&wheel| stuck >> wheel & 1 == 1) {
            let alone = self.alone[wheel]?;
            for (sum, (with, without)) in zip(&mut beyond, &alone, &self.nominal) {
                *sum -= with - without;
            }
        }
        Some(Beyond {
            motion: beyond
                .motion
                .map(|at_nodes| Curve::from_terms((self.to_curve * at_nodes).into())),
            rates: beyond.rates.map(|at_nodes| RateModel {
                droop_rad_s: (self.to_droop * -at_nodes).into(),
                ..RateModel::NONE
            }),
        })
    }
}

type Nodes = SVector<f64, NODES>;

/// The quantities of three equilibria side by side.
fn zip<'a>(
    sum: &'a mut Equilibrium,
    with: &'a Equilibrium,
    without: &'a Equilibrium,
) -> impl Iterator<Item = (&'a mut Nodes, (&'a Nodes, &'a Nodes))> {
    let sums = sum.motion.iter_mut().chain(&mut sum.rates);
    let with = with.motion.iter().chain(&with.rates);
    sums.zip(with.zip(without.motion.iter().chain(&without.rates)))
}

fn solve(slip: &SlipModel, nodes: &[(f64, f64); NODES], stuck: u32) -> Option<Equilibrium> {
    let mut found = Equilibrium {
        motion: [SVector::zeros(); 3],
        rates: [SVector::zeros(); WHEELS],
    };
    for (node, &(curvature, speed)) in nodes.iter().enumerate() {
        let situation = Situation {
            curvature_1_m: curvature,
            speed_m_s: speed,
            stuck: std::array::from_fn(|wheel| stuck >> wheel & 1 == 1),
            soil: Soil::default(),
            condition: Condition::default(),
        };
        let solution = slip.solve(&situation, None).ok()?;
        let [forward, lateral, yaw] = solution.velocity;
        for (axis, velocity) in [yaw, forward, lateral].into_iter().enumerate() {
            found.motion[axis][node] = velocity / speed;
        }
        let rates = found.rates.iter_mut().zip(solution.wheel_rate_rad_s);
        rates.for_each(|(at_nodes, rate)| at_nodes[node] = rate);
    }
    Some(found)
}

/// The matrix that takes values at the nodes to coefficients of the least sum of squares.
fn least_squares<const TERMS: usize>(
    basis: &SMatrix<f64, NODES, TERMS>,
) -> Option<SMatrix<f64, TERMS, NODES>> {
    let normal = basis.tr_mul(basis).cholesky()?;
    Some(normal.solve(&basis.transpose()))
}
