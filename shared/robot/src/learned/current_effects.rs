//! What a weak motor or a stuck wheel makes of the currents of all wheels.
//!
//! Healthy runs hold neither. The equilibrium of forces ([`crate::slip`]) says both relative to
//! the current that the wheel would carry: a motor that has lost a share of its gain gives way,
//! and the others carry what it no longer does. The stiffer the soil holds its wheel, the slower
//! the robot drives, the more of its current it loses.

use vigil_blocks::WHEELS;

use super::Model;
use crate::description::Description;
use crate::kinematics::ROVER_WHEELS;
use crate::slip::{Condition, Situation, SlipModel};

/// Shares of torque lost for which the effects are known. Half a loss shows by 2.8 to 4 deviations
/// in 2 s, a third by fewer than three.
pub const SHARES: [f64; 5] = [0.35, 0.5, 0.7, 0.85, 1.0];
/// What is solved for: the shares, and the wheel stuck.
const KINDS: usize = SHARES.len() + 1;
/// Kind of a stuck wheel.
pub const STUCK: usize = SHARES.len();
/// Curvatures and speeds at which the effects are solved, between the ends of the learned ranges;
/// the effects between them are linear. Chosen: each node costs the start of a service a solution.
const TURNS: usize = 5;
const SPEEDS: usize = 3;
/// Currents smaller than this are no measure of an effect, as a torque, N m. Chosen: a twentieth of
/// the rover's dry friction. Smaller divides by almost nothing; larger understates effects.
const TORQUE_MIN_N_M: f64 = 1e-3;

/// Changes of all currents over the current that the wheel would carry.
pub type Effect = [f64; WHEELS];

/// Effects at the nodes of curvature and speed.
#[derive(Debug, Clone)]
pub struct CurrentEffects {
    /// By kind, wheel, speed and turn.
    nodes: Vec<Effect>,
    curvature_max: f64,
    speeds: [f64; 2],
}

impl CurrentEffects {
    /// The effects on one robot; None if it is no rocker-bogie rover.
    #[must_use]
    pub fn new(model: &Model, robot: &Description) -> Option<Self> {
        let slip = SlipModel::new(robot).ok()?;
        let curvature_max = model.command.curvature_max_1_m;
        let speeds = model.command.speed_range_m_s;
        let mut nodes = Vec::with_capacity(KINDS * WHEELS * SPEEDS * TURNS);
        for kind in 0..KINDS {
            for wheel in 0..WHEELS {
                for node in 0..SPEEDS * TURNS {
                    let along = (node % TURNS) as f64 / (TURNS - 1) as f64;
                    let share = (node / TURNS) as f64 / (SPEEDS - 1) as f64;
                    let curvature = curvature_max * (2.0 * along - 1.0);
                    let speed = speeds[0] + share * (speeds[1] - speeds[0]);
                    nodes.push(match wheel < ROVER_WHEELS {
                        true => effect(&slip, curvature, speed, kind, wheel)?,
                        false => [0.0; WHEELS],
                    });
                }
            }
        }
        Some(Self {
            nodes,
            curvature_max,
            speeds,
        })
    }

    /// Changes of all currents over the current that `wheel` would carry, at a curvature (1/m) and
    /// speed (m/s), of a `kind`: an index of [`SHARES`], or [`STUCK`].
    #[must_use]
    pub fn at(&self, kind: usize, wheel: usize, curvature: f64, speed: f64) -> Effect {
        let place = |value: f64, low: f64, high: f64, count: usize| {
            let at = (value - low) / (high - low) * (count - 1) as f64;
            let at = at.clamp(0.0, (count - 1) as f64);
            let node = (at as usize).min(count - 2);
            (node, at - node as f64)
        };
        let limit = self.curvature_max;
        let (turn, right) = place(curvature, -limit, limit, TURNS);
        let [slowest, fastest] = self.speeds;
        let (slow, faster) = place(speed.abs(), slowest, fastest.max(slowest + 1e-6), SPEEDS);
        let first = (kind * WHEELS + wheel) * SPEEDS * TURNS;
        let mut out = [0.0; WHEELS];
        for (row, weight) in [(slow, 1.0 - faster), (slow + 1, faster)] {
            for (column, share) in [(turn, 1.0 - right), (turn + 1, right)] {
                let Some(node) = self.nodes.get(first + row * TURNS + column) else {
                    continue;
                };
                for (out, value) in out.iter_mut().zip(node) {
                    *out += weight * share * value;
                }
            }
        }
        out
    }
}

fn effect(
    slip: &SlipModel,
    curvature_1_m: f64,
    speed_m_s: f64,
    kind: usize,
    wheel: usize,
) -> Option<Effect> {
    let torques = |lost: f64, is_stuck: bool| {
        let mut condition = Condition::default();
        condition.wheels[wheel].torque_share = 1.0 - lost;
        let mut stuck = [false; ROVER_WHEELS];
        stuck[wheel] = is_stuck;
        let situation = Situation {
            curvature_1_m,
            speed_m_s,
            stuck,
            soil: slip.soil(),
            condition,
        };
        Some(slip.solve(&situation, None).ok()?.torque_n_m)
    };
    let healthy = torques(0.0, false)?;
    let broken = match SHARES.get(kind) {
        Some(&lost) => torques(lost, false)?,
        None => torques(0.0, true)?,
    };
    let own = healthy[wheel];
    let own = own.abs().max(TORQUE_MIN_N_M).copysign(own);
    let mut out = [0.0; WHEELS];
    for (out, (broken, healthy)) in out.iter_mut().zip(broken.iter().zip(healthy)) {
        *out = (broken - healthy) / own;
    }
    Some(out)
}
