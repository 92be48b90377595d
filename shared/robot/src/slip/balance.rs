//! The nine equations: forces and moment on the body, torque on each wheel.

use nalgebra::SMatrix;

use super::loads::SideWeight;
use super::shear::{Contact, Heading, HubVelocity, Shear};
use super::{Condition, Situation, SlipModel, UNKNOWNS, Unknowns};
use crate::kinematics::{ROVER_WHEELS, WheelTargets};

/// Weight of the motors' rows (N m) against the forces' (N), for conditioning. Chosen: it
/// shapes the way to the solution, not the solution.
pub(super) const MOTOR_SCALE: f64 = 5.0;
/// Wheel rate within which dry bearing friction changes its sign smoothly, rad/s. Chosen: far below
/// any driving rate; at 0 Newton's method meets a step.
const DRY_SMOOTHING_RAD_S: f64 = 0.01;
/// Step of the forward differences, in the unit of the unknown: about the root of a double's
/// resolution, where truncation and rounding errors are alike (Press et al., Numerical Recipes
/// 5.7).
const DIFFERENCE: f64 = 1e-7;

/// Derivatives by the unknowns.
pub(super) type Jacobian = SMatrix<f64, UNKNOWNS, UNKNOWNS>;

/// The equations of one situation.
pub(super) struct Balance<'a> {
    model: &'a SlipModel,
    contacts: [Contact; ROVER_WHEELS],
    commanded_rad_s: [f64; ROVER_WHEELS],
    stuck: [bool; ROVER_WHEELS],
    condition: &'a Condition,
    side_weights: [SideWeight; 2],
    /// Force and moment from outside, but for drag.
    wrench: [f64; 3],
}

impl<'a> Balance<'a> {
    pub(super) fn new(
        model: &'a SlipModel,
        situation: &'a Situation,
        targets: &WheelTargets,
    ) -> Self {
        let condition = &situation.condition;
        let contacts = std::array::from_fn(|i| {
            let wheel = &condition.wheels[i];
            let servo_rad = wheel.steer_held_rad.unwrap_or(targets.steer_rad[i]);
            let (sin, cos) = (servo_rad + wheel.steer_offset_rad).sin_cos();
            Contact {
                heading: Heading { cos, sin },
                radius_m: model.kinematics.wheel_radius_m * wheel.radius_share,
                friction: situation.soil.friction[i],
                shear_modulus: situation.soil.shear_modulus,
                resistance: wheel.resistance,
            }
        });
        Self {
            model,
            contacts,
            commanded_rad_s: targets.rate_rad_s,
            stuck: situation.stuck,
            condition,
            side_weights: model.side_weights(condition),
            wrench: condition.wrench(model.weight_n),
        }
    }

    /// The motion without any slip, stuck wheels at rest: where the search starts.
    pub(super) fn ideal(&self, speed_m_s: f64, curvature_1_m: f64) -> Unknowns {
        let mut unknowns = Unknowns::zeros();
        unknowns[0] = speed_m_s;
        unknowns[2] = speed_m_s * curvature_1_m;
        for i in 0..ROVER_WHEELS {
            unknowns[3 + i] = self.commanded_rad_s[i];
        }
        self.hold_stuck(&unknowns)
    }

    /// `unknowns` with the stuck wheels at rest.
    pub(super) fn hold_stuck(&self, unknowns: &Unknowns) -> Unknowns {
        let mut held = *unknowns;
        for i in 0..ROVER_WHEELS {
            if self.stuck[i] {
                held[3 + i] = 0.0;
            }
        }
        held
    }

    /// Loads on the wheels, N.
    pub(super) fn loads(&self, unknowns: &Unknowns) -> [f64; ROVER_WHEELS] {
        self.loads_of(&std::array::from_fn(|i| self.shear(i, unknowns)))
    }

    /// Residuals: body forces N, moment N m, and the motors' torques times [`MOTOR_SCALE`].
    pub(super) fn residual(&self, unknowns: &Unknowns) -> Unknowns {
        let shears = std::array::from_fn(|i| self.shear(i, unknowns));
        let loads = self.loads_of(&shears);
        let (x, y) = (&self.model.kinematics.x_m, &self.model.kinematics.y_m);
        let mut residual = Unknowns::zeros();
        for (row, force) in self.wrench.into_iter().enumerate() {
            residual[row] = force;
        }
        for i in 0..ROVER_WHEELS {
            let drag = self.condition.wheels[i].drag(self.hub(i, unknowns));
            let fx = loads[i] * shears[i].x + drag[0];
            let fy = loads[i] * shears[i].y + drag[1];
            residual[0] += fx;
            residual[1] += fy;
            residual[2] += x[i] * fy - y[i] * fx;
            let rate = unknowns[3 + i];
            residual[3 + i] = if self.stuck[i] {
                -rate
            } else {
                MOTOR_SCALE * (self.drive(i, rate) - loads[i] * shears[i].along * self.radius(i))
            };
        }
        residual
    }

    /// Derivatives of [`Self::residual`]. Each wheel's force depends on three numbers only (hub
    /// velocity and rate) and each load on three forces, so differences are taken there and
    /// chained: a quarter of the work of differencing all nine equations nine times.
    pub(super) fn jacobian(&self, unknowns: &Unknowns) -> Jacobian {
        let (x, y) = (&self.model.kinematics.x_m, &self.model.kinematics.y_m);
        let shears: [Shear; ROVER_WHEELS] = std::array::from_fn(|i| self.shear(i, unknowns));
        let loads = self.loads_of(&shears);
        // Gradient of each wheel's forward, lateral and in-plane force by all unknowns.
        let gradients: [[Unknowns; 3]; ROVER_WHEELS] =
            std::array::from_fn(|i| self.shear_gradient(i, unknowns, &shears[i]));
        let mut jacobian = Jacobian::zeros();
        for (side, weight) in self.model.sides.iter().zip(self.side_weights) {
            let sensitivity = self.load_sensitivity(side, weight, &shears);
            for (k, &i) in side.iter().enumerate() {
                let [by_x, by_y, by_along] = &gradients[i];
                let mut load = Unknowns::zeros();
                for (j, &other) in side.iter().enumerate() {
                    load += gradients[other][0] * sensitivity[k][j];
                }
                let drag = self.drag_gradient(i, unknowns);
                let fx = by_x * loads[i] + load * shears[i].x + drag[0];
                let fy = by_y * loads[i] + load * shears[i].y + drag[1];
                let along = by_along * loads[i] + load * shears[i].along;
                for column in 0..UNKNOWNS {
                    jacobian[(0, column)] += fx[column];
                    jacobian[(1, column)] += fy[column];
                    jacobian[(2, column)] += x[i] * fy[column] - y[i] * fx[column];
                }
                let row = 3 + i;
                if self.stuck[i] {
                    jacobian[(row, row)] = -1.0;
                    continue;
                }
                let rate = unknowns[row];
                let drive = (self.drive(i, rate + DIFFERENCE) - self.drive(i, rate)) / DIFFERENCE;
                for column in 0..UNKNOWNS {
                    jacobian[(row, column)] = -MOTOR_SCALE * self.radius(i) * along[column];
                }
                jacobian[(row, row)] += MOTOR_SCALE * drive;
            }
        }
        jacobian
    }

    fn radius(&self, i: usize) -> f64 {
        self.contacts[i].radius_m
    }

    /// Torque of motor and bearing on wheel `i`, N m.
    fn drive(&self, i: usize, rate: f64) -> f64 {
        let motor = &self.model.motor;
        let share = self.condition.wheels[i].torque_share;
        motor.torque(share, self.commanded_rad_s[i], rate)
            - motor.viscous_friction_n_m_s * rate
            - motor.dry_friction_n_m * (rate / DRY_SMOOTHING_RAD_S).tanh()
    }

    fn shear(&self, i: usize, unknowns: &Unknowns) -> Shear {
        self.contacts[i].shear(self.hub(i, unknowns), unknowns[3 + i])
    }

    fn hub(&self, i: usize, unknowns: &Unknowns) -> HubVelocity {
        let kinematics = &self.model.kinematics;
        HubVelocity {
            forward_m_s: unknowns[0] - unknowns[2] * kinematics.y_m[i],
            left_m_s: unknowns[1] + unknowns[2] * kinematics.x_m[i],
        }
    }

    fn loads_of(&self, shears: &[Shear; ROVER_WHEELS]) -> [f64; ROVER_WHEELS] {
        let mut loads = [0.0; ROVER_WHEELS];
        for (side, weight) in self.model.sides.iter().zip(self.side_weights) {
            let side_loads = self.side_loads(side, weight, side.map(|i| shears[i].x));
            for (&i, load) in side.iter().zip(side_loads) {
                loads[i] = load;
            }
        }
        loads
    }

    fn side_loads(&self, side: &[usize; 3], weight: SideWeight, traction: [f64; 3]) -> [f64; 3] {
        let model = self.model;
        model
            .linkage
            .loads(&model.kinematics, side, weight, traction)
    }

    /// d(load k)/d(forward force j per unit of load) on one side, N.
    fn load_sensitivity(
        &self,
        side: &[usize; 3],
        weight: SideWeight,
        shears: &[Shear; ROVER_WHEELS],
    ) -> [[f64; 3]; 3] {
        let traction = side.map(|i| shears[i].x);
        let loads = self.side_loads(side, weight, traction);
        let mut sensitivity = [[0.0; 3]; 3];
        for j in 0..3 {
            let mut moved = traction;
            moved[j] += DIFFERENCE;
            let moved = self.side_loads(side, weight, moved);
            for k in 0..3 {
                sensitivity[k][j] = (moved[k] - loads[k]) / DIFFERENCE;
            }
        }
        sensitivity
    }

    /// Gradients of wheel `i`'s (x, y, along) by all unknowns.
    fn shear_gradient(&self, i: usize, unknowns: &Unknowns, at: &Shear) -> [Unknowns; 3] {
        let (hub, rate) = (self.hub(i, unknowns), unknowns[3 + i]);
        let contact = &self.contacts[i];
        let by = |moved: Shear| {
            [moved.x - at.x, moved.y - at.y, moved.along - at.along].map(|d| d / DIFFERENCE)
        };
        let by_forward = by(contact.shear(hub.faster_forward(DIFFERENCE), rate));
        let by_left = by(contact.shear(hub.faster_left(DIFFERENCE), rate));
        let by_rate = by(contact.shear(hub, rate + DIFFERENCE));
        std::array::from_fn(|q| {
            let mut gradient = self.by_body(i, by_forward[q], by_left[q]);
            gradient[3 + i] = by_rate[q];
            gradient
        })
    }

    /// Gradients of the drag above wheel `i`, forward and left, by all unknowns.
    fn drag_gradient(&self, i: usize, unknowns: &Unknowns) -> [Unknowns; 2] {
        let wheel = &self.condition.wheels[i];
        if wheel.drag_n == 0.0 {
            return [Unknowns::zeros(); 2];
        }
        let hub = self.hub(i, unknowns);
        let at = wheel.drag(hub);
        let by = |moved: [f64; 2]| [moved[0] - at[0], moved[1] - at[1]].map(|d| d / DIFFERENCE);
        let by_forward = by(wheel.drag(hub.faster_forward(DIFFERENCE)));
        let by_left = by(wheel.drag(hub.faster_left(DIFFERENCE)));
        std::array::from_fn(|q| self.by_body(i, by_forward[q], by_left[q]))
    }

    /// A gradient by the velocity of hub `i`, as one by the body's velocity.
    fn by_body(&self, i: usize, by_forward: f64, by_left: f64) -> Unknowns {
        let kinematics = &self.model.kinematics;
        let mut gradient = Unknowns::zeros();
        gradient[0] = by_forward;
        gradient[1] = by_left;
        gradient[2] = kinematics.x_m[i] * by_left - kinematics.y_m[i] * by_forward;
        gradient
    }
}
