//! Loads on the wheels of a rocker-bogie linkage.
//!
//! Each side carries half of the weight: the rocker rests on the front wheel and on the bogie's
//! pivot, the bogie on the middle and the rear wheel; the differential leaves each rocker free to
//! turn. Traction at the ground acts below the pivots and therefore shifts load between wheels.

use crate::chassis::RockerBogie;
use crate::kinematics::{Ackermann6, GeometryError, ROVER_WHEELS};

/// Smallest load left on a wheel, N. Chosen: 1.4 % of the rover's weight, so that the equations
/// keep a solution; at 0 a lifted wheel's rate is undetermined.
const LOAD_MIN_N: f64 = 2.0;
/// Traction per unit of load up to which load is shifted, either way. At 0.97 (its lever over its
/// height) the reference bogie would tip over; soils below this friction never come here.
const TRACTION_MAX: f64 = 0.85;

/// Weight on one side of the rover.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SideWeight {
    /// Weight, N.
    pub weight_n: f64,
    /// Distance ahead of the rocker's pivot at which it acts, m.
    pub ahead_m: f64,
}

impl RockerBogie {
    /// Wheels of the left and the right side, each as (front, middle, rear).
    pub(super) fn sides(
        &self,
        robot: &str,
        kinematics: &Ackermann6,
    ) -> Result<[[usize; 3]; 2], GeometryError> {
        let mut sides = [[0; 3]; 2];
        let mut count = [0; 2];
        for i in 0..ROVER_WHEELS {
            let side = usize::from(kinematics.y_m[i] < 0.0);
            if count[side] < 3 && kinematics.y_m[i] != 0.0 {
                sides[side][count[side]] = i;
            }
            count[side] += 1;
        }
        let x = |i: usize| kinematics.x_m[i];
        for side in &mut sides {
            side.sort_unstable_by(|&a, &b| x(b).total_cmp(&x(a)));
        }
        let in_line = |side: &[usize; 3]| x(side[0]) > x(side[1]) && x(side[1]) > x(side[2]);
        if count != [3, 3] || !sides.iter().all(in_line) {
            return Err(GeometryError::Sides {
                robot: robot.to_owned(),
                left: count[0],
                right: count[1],
            });
        }
        for (side, name) in sides.iter().zip(["left", "right"]) {
            let [front, middle, rear] = side.map(x);
            let (rocker, bogie) = (self.rocker_x_m, self.bogie_x_m);
            if !(front > rocker && rocker > bogie && middle > bogie && bogie > rear) {
                return Err(GeometryError::Pivots {
                    robot: robot.to_owned(),
                    side: name,
                    front,
                    middle,
                    rear,
                    rocker,
                    bogie,
                });
            }
            if !self.stands(front, middle, rear) {
                return Err(GeometryError::Tips {
                    robot: robot.to_owned(),
                    side: name,
                    rocker: self.rocker_z_m,
                    bogie: self.bogie_z_m,
                });
            }
        }
        Ok(sides)
    }

    /// True if no traction up to [`TRACTION_MAX`] turns a lever of [`Self::loads`] round.
    fn stands(&self, front: f64, middle: f64, rear: f64) -> bool {
        let pull = TRACTION_MAX * self.bogie_z_m.abs();
        let rocker_pull = TRACTION_MAX * self.rocker_z_m.abs();
        let drop_pull = TRACTION_MAX * (self.rocker_z_m - self.bogie_z_m).abs();
        middle - self.bogie_x_m > pull
            && self.bogie_x_m - rear > pull
            && front - self.rocker_x_m > rocker_pull
            && front - self.bogie_x_m > rocker_pull + drop_pull
    }

    /// Loads on (front, middle, rear) of one side, N, for the weight on it and the forward forces
    /// per unit of load, `traction`, of the same wheels.
    ///
    /// The moments about the bogie's pivot give the ratio of rear to middle load, those about the
    /// rocker's pivot the load on the bogie. Forces are linear in the loads, so no iteration is
    /// needed.
    #[must_use]
    pub fn loads(
        &self,
        kinematics: &Ackermann6,
        side: &[usize; 3],
        weight: SideWeight,
        traction: [f64; 3],
    ) -> [f64; 3] {
        let side_n = weight.weight_n;
        let [front_x, middle_x, rear_x] = side.map(|i| kinematics.x_m[i]);
        let traction = traction.map(|pull| pull.clamp(-TRACTION_MAX, TRACTION_MAX));
        let (middle_arm, rear_arm) = (middle_x - self.bogie_x_m, self.bogie_x_m - rear_x);
        let front_arm = front_x - self.rocker_x_m;
        let span = front_x - self.bogie_x_m;
        let drop = self.rocker_z_m - self.bogie_z_m;

        let ratio =
            (middle_arm + self.bogie_z_m * traction[1]) / (rear_arm - self.bogie_z_m * traction[2]);
        let bogie_traction = (traction[1] + ratio * traction[2]) / (1.0 + ratio);
        let front_moment = self.rocker_z_m * traction[0];
        let bogie = side_n * (front_arm - weight.ahead_m + front_moment)
            / (span + front_moment - drop * bogie_traction);
        let middle = bogie / (1.0 + ratio);
        [side_n - bogie, middle, ratio * middle].map(|load| load.max(LOAD_MIN_N))
    }
}
