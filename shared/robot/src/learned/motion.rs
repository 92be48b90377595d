//! Displacement per commanded metre as a polynomial of the signed curvature, and its noise.

use nalgebra::{Matrix3, Vector3};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use vigil_inference::track::MotionNoise;

/// Speed about which the effect of speed is expressed, m/s: the middle of what the rover's model
/// was learned from. With another one learning finds another constant, and the same curve.
const SPEED_REFERENCE_M_S: f64 = 0.2;
/// `Σ c_i κ^i + d (1/|v| - 5 s/m)`: the paper's 4th-order polynomial in the signed curvature (the
/// radius would have a pole straight ahead), plus the effect of speed on friction.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Curve {
    /// Coefficients of κ^0 to κ^4, κ in 1/m.
    pub curvature: [f64; 5],
    /// Coefficient of the inverse speed, (m/s) per unit.
    pub inverse_speed: f64,
}

impl Curve {
    /// Number of terms.
    pub const TERMS: usize = 6;
    /// Speeds below this one count as this one where a speed divides, m/s: half of the slowest that
    /// was learned from.
    pub const SPEED_FLOOR_M_S: f64 = 0.05;

    /// `by_m_s / |v|`: what changes the speed by the same at every speed, per commanded metre.
    #[must_use]
    pub(crate) const fn of_inverse_speed(by_m_s: f64) -> Self {
        Self {
            curvature: [by_m_s / SPEED_REFERENCE_M_S, 0.0, 0.0, 0.0, 0.0],
            inverse_speed: by_m_s,
        }
    }

    /// The terms at a curvature (1/m) and speed (m/s).
    #[must_use]
    pub fn basis(curvature: f64, speed: f64) -> [f64; Self::TERMS] {
        let k = curvature;
        let slow = 1.0 / speed.abs().max(Self::SPEED_FLOOR_M_S) - 1.0 / SPEED_REFERENCE_M_S;
        [1.0, k, k * k, k * k * k, k * k * k * k, slow]
    }

    /// The curve with these coefficients of [`Self::basis`].
    #[must_use]
    pub const fn from_terms(c: [f64; Self::TERMS]) -> Self {
        Self {
            curvature: [c[0], c[1], c[2], c[3], c[4]],
            inverse_speed: c[5],
        }
    }

    /// Coefficients in the order of [`Self::basis`].
    #[must_use]
    pub const fn terms(&self) -> [f64; Self::TERMS] {
        let c = self.curvature;
        [c[0], c[1], c[2], c[3], c[4], self.inverse_speed]
    }

    /// Value at a curvature and speed.
    #[must_use]
    pub fn value(&self, curvature: f64, speed: f64) -> f64 {
        let terms = self.terms();
        Self::basis(curvature, speed)
            .iter()
            .zip(terms)
            .map(|(basis, c)| basis * c)
            .sum()
    }
}

/// Motion of one mode, in the body frame, per commanded metre.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct MotionModel {
    /// Standard deviation of an offset that is constant in a run: yaw rad/m, forward, lateral m/m.
    pub offset_sd: [f64; 3],
    /// Stationary standard deviation of coloured deviations (soil) along the path, same units.
    pub deviation_sd: [f64; 3],
    /// Correlation length of the coloured deviations, m.
    pub deviation_length_m: f64,
    /// Correlation of yaw with forward, in offset and coloured deviation, within ±0.99.
    pub correlation: f64,
    /// White noise: standard deviation per square root of a metre, same order.
    pub white_sd: [f64; 3],
    /// Change of yaw per commanded metre, rad/m.
    pub yaw: Curve,
    /// Travel forward per commanded metre.
    pub forward: Curve,
    /// Travel to the left per commanded metre.
    pub lateral: Curve,
}

impl MotionModel {
    /// Expected yaw, forward and lateral displacement per commanded metre. Beyond `curvature_max`
    /// the yaw follows the command and the deviation from it stays what it is at the limit.
    #[must_use]
    pub fn per_metre(&self, curvature: f64, speed: f64, curvature_max: f64) -> [f64; 3] {
        let inside = curvature.clamp(-curvature_max, curvature_max);
        [
            self.yaw.value(inside, speed) + (curvature - inside),
            self.forward.value(inside, speed),
            self.lateral.value(inside, speed),
        ]
    }

    /// The noise as the track takes it.
    #[must_use]
    pub fn noise(&self) -> MotionNoise {
        MotionNoise {
            offset: covariance(self.offset_sd, self.correlation),
            deviation: covariance(self.deviation_sd, self.correlation),
            length_m: self.deviation_length_m,
            white: Vector3::from(self.white_sd.map(|sd| sd * sd)),
            drift: Vector3::zeros(),
            bound: Vector3::repeat(f64::INFINITY),
            changes_1_m: 0.0,
        }
    }
}

fn covariance(sd: [f64; 3], correlation: f64) -> Matrix3<f64> {
    let mut out = Matrix3::from_diagonal(&Vector3::from(sd.map(|sd| sd * sd)));
    out[(0, 1)] = correlation * sd[0] * sd[1];
    out[(1, 0)] = out[(0, 1)];
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_curve_is_the_polynomial() {
        let curve = Curve {
            curvature: [1.0, 2.0, 3.0, 4.0, 5.0],
            inverse_speed: 0.1,
        };
        assert!((curve.value(0.5, 0.2) - (1.0 + 1.0 + 0.75 + 0.5 + 0.3125)).abs() < 1e-12);
        assert!((curve.value(0.0, 0.1) - 1.5).abs() < 1e-12);
        assert!(curve.value(0.0, 0.0).is_finite());
    }
}
