//! Quasi-static slip of a six-wheel rocker-bogie rover: how the body moves when the wheels are
//! driven, steered and, some of them, stuck.
//!
//! The body is in equilibrium of the wheels' shear forces (Janosi-type law, [`shear`]); the load
//! on each wheel follows from these forces through the rocker-bogie linkage ([`loads`]); each
//! free wheel's motor balances traction and bearing friction; a stuck wheel stands still and is
//! dragged. Nine unknowns (forward, lateral and yaw velocity, six wheel rates) are solved by a
//! damped Newton method with a pseudo-transient fallback ([`solver`]).
//!
//! Without the load transfer the front and rear wheel of one side would turn the rover equally,
//! and no pose sensor could tell which of them is stuck.
//!
//! Slopes, an off-centre mass, forces from outside and wheels that are not as built enter by a
//! [`Condition`]. Left out: load transfer by lateral forces of the wheels, transients.

mod balance;
mod condition;
pub mod loads;
pub mod shear;
mod solver;

pub use condition::{Condition, WheelCondition};

use nalgebra::SVector;

use loads::SideWeight;

use crate::chassis::{Motor, RockerBogie};
use crate::description::Description;
use crate::kinematics::{Ackermann6, GeometryError, ROVER_WHEELS, WheelTargets};

/// Standard gravity as the weight of the reference rover assumes it, m/s².
const GRAVITY_M_S2: f64 = 9.81;
/// From this many stuck wheels on the rover cannot move: the free wheels spin in place. True of six
/// wheels on the rover's ground.
pub const IMMOBILE_STUCK: usize = 4;

/// Number of unknowns.
pub const UNKNOWNS: usize = 9;
/// Forward m/s, lateral m/s, yaw rate rad/s, then the six wheel rates rad/s.
pub type Unknowns = SVector<f64, UNKNOWNS>;

impl Motor {
    /// Its quantities, all of which are above 0.
    const fn quantities(&self) -> [(&'static str, f64); 4] {
        [
            ("motor.gain_n_m_s", self.gain_n_m_s),
            ("motor.torque_max_n_m", self.torque_max_n_m),
            ("motor.dry_friction_n_m", self.dry_friction_n_m),
            ("motor.viscous_friction_n_m_s", self.viscous_friction_n_m_s),
        ]
    }

    /// Torque of a motor of which `share` is left, N m.
    fn torque(&self, share: f64, commanded_rad_s: f64, rate_rad_s: f64) -> f64 {
        let limit = share * self.torque_max_n_m;
        (share * self.gain_n_m_s * (commanded_rad_s - rate_rad_s)).clamp(-limit, limit)
    }
}

/// The soil under the wheels.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Soil {
    /// Friction coefficient under each wheel.
    pub friction: [f64; ROVER_WHEELS],
    /// Shear modulus: relative slip at which 63 % of the friction is reached.
    pub shear_modulus: f64,
}

impl Soil {
    /// The same soil under every wheel.
    #[must_use]
    pub const fn uniform(friction: f64, shear_modulus: f64) -> Self {
        Self {
            friction: [friction; ROVER_WHEELS],
            shear_modulus,
        }
    }
}

/// What to solve for.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Situation {
    /// Commanded signed curvature, 1/m.
    pub curvature_1_m: f64,
    /// Commanded speed, m/s.
    pub speed_m_s: f64,
    /// Which wheels are stuck.
    pub stuck: [bool; ROVER_WHEELS],
    /// The soil.
    pub soil: Soil,
    /// What is not as built, and forces from outside.
    pub condition: Condition,
}

/// Steady motion of the rover.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Solution {
    /// Body velocity at the centre: forward m/s, left m/s, yaw rate rad/s.
    pub velocity: [f64; 3],
    /// Wheel rates, rad/s; exactly 0 for stuck wheels.
    pub wheel_rate_rad_s: [f64; ROVER_WHEELS],
    /// Loads on the wheels, N.
    pub load_n: [f64; ROVER_WHEELS],
    /// Motor torques, N m, within the motors' limit.
    pub torque_n_m: [f64; ROVER_WHEELS],
    /// Iterations that it took, both methods together.
    pub iterations: u32,
}

impl Solution {
    /// The unknowns behind this solution, to start the next solve from.
    #[must_use]
    pub fn unknowns(&self) -> Unknowns {
        let ([vx, vy, omega], rate) = (self.velocity, self.wheel_rate_rad_s);
        Unknowns::from([
            vx, vy, omega, rate[0], rate[1], rate[2], rate[3], rate[4], rate[5],
        ])
    }
}

/// Why a situation has no solution here.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum SlipError {
    /// A number of the situation is not finite, or the soil is impossible.
    #[error(
        "{0} is impossible: it must be finite, friction, shear modulus and radii above 0, shares \
         of torque 0 to 1"
    )]
    Input(&'static str),
    /// Neither method converged.
    #[error(
        "no equilibrium found in {iterations} iterations: the residual is {residual} N, allowed \
         is {allowed} N"
    )]
    NotConverged {
        /// Iterations done.
        iterations: u32,
        /// Largest residual left, N.
        residual: f64,
        /// Largest residual allowed, N.
        allowed: f64,
    },
}

/// The slip model of one robot.
#[derive(Debug, Clone, PartialEq)]
pub struct SlipModel {
    kinematics: Ackermann6,
    linkage: RockerBogie,
    /// Wheels of the left and of the right side: front, middle, rear.
    sides: [[usize; 3]; 2],
    motor: Motor,
    soil: Soil,
    weight_n: f64,
}

impl SlipModel {
    /// The model of `robot`.
    ///
    /// # Errors
    /// [`GeometryError`] if the robot is not a six-wheel rocker-bogie rover, or its description
    /// lacks a table.
    pub fn new(robot: &Description) -> Result<Self, GeometryError> {
        let kinematics = Ackermann6::new(robot)?;
        let without = |table| GeometryError::Table {
            robot: robot.name.clone(),
            table,
        };
        let linkage = robot.linkage.ok_or_else(|| without("linkage"))?;
        let motor = robot.motor.ok_or_else(|| without("motor"))?;
        let ground = robot.ground.ok_or_else(|| without("ground"))?;
        check_above_0(robot, &[("mass_kg", robot.mass_kg)])?;
        check_above_0(
            robot,
            &[
                ("ground.friction", ground.friction),
                ("ground.shear_modulus", ground.shear_modulus),
            ],
        )?;
        check_above_0(robot, &motor.quantities())?;
        let sides = linkage.sides(&robot.name, &kinematics)?;
        Ok(Self {
            kinematics,
            linkage,
            sides,
            motor,
            soil: Soil::uniform(ground.friction, ground.shear_modulus),
            weight_n: robot.mass_kg * GRAVITY_M_S2,
        })
    }

    /// The ground of the robot's description under every wheel.
    #[must_use]
    pub const fn soil(&self) -> Soil {
        self.soil
    }

    /// The ideal kinematics behind the model.
    #[must_use]
    pub const fn kinematics(&self) -> &Ackermann6 {
        &self.kinematics
    }

    /// The steady motion in `situation`, starting the search from the ideal motion or from `start`
    /// (the solution of a similar situation).
    ///
    /// With [`IMMOBILE_STUCK`] or more stuck wheels the body stands still and the free wheels
    /// spin. At speed 0 everything stands still, exactly.
    ///
    /// # Errors
    /// [`SlipError`] for impossible input, and if neither method converges.
    pub fn solve(
        &self,
        situation: &Situation,
        start: Option<&Unknowns>,
    ) -> Result<Solution, SlipError> {
        check(situation)?;
        let targets = self
            .kinematics
            .targets(situation.curvature_1_m, situation.speed_m_s);
        if situation.speed_m_s == 0.0 {
            return Ok(self.at_rest([0.0; ROVER_WHEELS], situation, &targets));
        }
        if situation.stuck.iter().filter(|&&stuck| stuck).count() >= IMMOBILE_STUCK {
            return Ok(self.at_rest(self.spinning(situation, &targets), situation, &targets));
        }
        let balance = balance::Balance::new(self, situation, &targets);
        let ideal = balance.ideal(situation.speed_m_s, situation.curvature_1_m);
        let (unknowns, iterations) = solver::solve(&balance, start, &ideal)?;
        Ok(Solution {
            velocity: [unknowns[0], unknowns[1], unknowns[2]],
            wheel_rate_rad_s: std::array::from_fn(|i| unknowns[3 + i]),
            load_n: balance.loads(&unknowns),
            torque_n_m: std::array::from_fn(|i| {
                self.torque(situation, i, targets.rate_rad_s[i], unknowns[3 + i])
            }),
            iterations,
        })
    }

    fn torque(&self, situation: &Situation, i: usize, commanded_rad_s: f64, rate: f64) -> f64 {
        let share = situation.condition.wheels[i].torque_share;
        self.motor.torque(share, commanded_rad_s, rate)
    }

    /// Standing still on the static loads.
    fn at_rest(
        &self,
        wheel_rate_rad_s: [f64; ROVER_WHEELS],
        situation: &Situation,
        targets: &WheelTargets,
    ) -> Solution {
        let load_n = self.static_loads(situation);
        Solution {
            velocity: [0.0; 3],
            wheel_rate_rad_s,
            load_n,
            torque_n_m: std::array::from_fn(|i| {
                self.torque(situation, i, targets.rate_rad_s[i], wheel_rate_rad_s[i])
            }),
            iterations: 0,
        }
    }

    /// Weight on each side.
    fn side_weights(&self, condition: &Condition) -> [SideWeight; 2] {
        let (linkage, kinematics) = (&self.linkage, &self.kinematics);
        let sides_n = condition.sides_n(self.weight_n, linkage, kinematics, &self.sides);
        sides_n.map(|weight_n| SideWeight {
            weight_n,
            ahead_m: condition.mass_offset_m[0],
        })
    }

    fn static_loads(&self, situation: &Situation) -> [f64; ROVER_WHEELS] {
        let mut load_n = [0.0; ROVER_WHEELS];
        let weights = self.side_weights(&situation.condition);
        for (side, weight) in self.sides.iter().zip(weights) {
            let side_loads = self.linkage.loads(&self.kinematics, side, weight, [0.0; 3]);
            for (&wheel, load) in side.iter().zip(side_loads) {
                load_n[wheel] = load;
            }
        }
        load_n
    }

    /// Rates of free wheels that spin under a body that does not move: the motor against the
    /// shear at full slip and the bearing.
    fn spinning(&self, situation: &Situation, targets: &WheelTargets) -> [f64; ROVER_WHEELS] {
        let load_n = self.static_loads(situation);
        let shear = 1.0 - (-1.0 / situation.soil.shear_modulus).exp();
        let motor = &self.motor;
        std::array::from_fn(|i| {
            if situation.stuck[i] {
                return 0.0;
            }
            let commanded = targets.rate_rad_s[i];
            let wheel = &situation.condition.wheels[i];
            let traction = situation.soil.friction[i] * shear * load_n[i];
            let radius_m = self.kinematics.wheel_radius_m * wheel.radius_share;
            let resistance = traction * radius_m + motor.dry_friction_n_m;
            let gain = motor.gain_n_m_s * wheel.torque_share;
            let drive = (gain * commanded.abs() - resistance).max(0.0);
            (drive / (gain + motor.viscous_friction_n_m_s)).copysign(commanded)
        })
    }
}

fn check_above_0(robot: &Description, all: &[(&'static str, f64)]) -> Result<(), GeometryError> {
    let is_wrong = |value: f64| !(value.is_finite() && value > 0.0);
    match all.iter().find(|(_, value)| is_wrong(*value)) {
        Some(&(quantity, found)) => Err(GeometryError::Quantity {
            robot: robot.name.clone(),
            quantity,
            found,
            allowed: " above 0",
        }),
        None => Ok(()),
    }
}

fn check(situation: &Situation) -> Result<(), SlipError> {
    let positive = |value: f64| value.is_finite() && value > 0.0;
    if !situation.curvature_1_m.is_finite() {
        return Err(SlipError::Input("curvature_1_m"));
    }
    if !situation.speed_m_s.is_finite() {
        return Err(SlipError::Input("speed_m_s"));
    }
    if !situation.soil.friction.iter().all(|&f| positive(f)) {
        return Err(SlipError::Input("friction"));
    }
    if !positive(situation.soil.shear_modulus) {
        return Err(SlipError::Input("shear_modulus"));
    }
    if !situation.condition.is_possible() {
        return Err(SlipError::Input("condition"));
    }
    Ok(())
}
