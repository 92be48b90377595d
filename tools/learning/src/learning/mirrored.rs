//! A model seen in a mirror: left and right exchanged.

use vigil_robot::learned::model::StuckModel;
use vigil_robot::learned::{Curve, MotionModel, RateModel};

/// The model of the wheel called `name`, which is opposite the one that `known` is of; `mirror`
/// names for every wheel the one opposite.
#[must_use]
pub fn stuck(known: &StuckModel, name: &str, mirror: &[usize]) -> StuckModel {
    let rate = |&opposite: &usize| {
        let [constant, linear, square] = known.rates[opposite].droop_rad_s;
        RateModel {
            droop_rad_s: [constant, -linear, square],
            ..known.rates[opposite]
        }
    };
    StuckModel {
        wheel: name.to_owned(),
        motion: MotionModel {
            yaw: curve(&known.motion.yaw, -1.0),
            forward: curve(&known.motion.forward, 1.0),
            lateral: curve(&known.motion.lateral, -1.0),
            correlation: -known.motion.correlation,
            ..known.motion
        },
        rates: mirror.iter().map(rate).collect(),
    }
}

/// `sign · f(-κ)`.
fn curve(curve: &Curve, sign: f64) -> Curve {
    let c = curve.curvature;
    Curve {
        curvature: [c[0], -c[1], c[2], -c[3], c[4]].map(|c| sign * c),
        inverse_speed: sign * curve.inverse_speed,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_mirrored_curve_has_the_other_sign_at_the_other_curvature() {
        let known = Curve {
            curvature: [0.2, 0.9, -0.1, 0.03, 0.05],
            inverse_speed: 0.01,
        };
        for (sign, k) in [(-1.0, 0.7), (1.0, -0.4)] {
            let found = curve(&known, sign).value(k, 0.1);
            assert!((found - sign * known.value(-k, 0.1)).abs() < 1e-12);
        }
    }
}
