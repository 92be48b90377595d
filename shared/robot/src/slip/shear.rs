//! Shear force between a wheel and the soil, after Janosi and Hanamoto, with the slip as shear
//! displacement.

use super::condition::resisting;

/// Slip speed below which the direction of the force is smoothed, m/s.
const SLIP_MIN_M_S: f64 = 1e-9;
/// Floor of the reference speed that makes slip relative, m/s.
const REFERENCE_MIN_M_S: f64 = 0.03;

/// One wheel as the soil sees it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Contact {
    /// Cosine and sine of the steering angle.
    pub heading: (f64, f64),
    /// Radius of the wheel, m.
    pub radius_m: f64,
    /// Friction coefficient.
    pub friction: f64,
    /// Shear modulus (relative slip).
    pub shear_modulus: f64,
    /// Resistance of the soil to rolling, force per unit of load.
    pub resistance: f64,
}

/// Shear force per unit of normal load.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Shear {
    /// Along the body's x.
    pub x: f64,
    /// Along the body's y.
    pub y: f64,
    /// Along the wheel's plane: what the motor feels.
    pub along: f64,
}

impl Contact {
    /// Force per unit of load for a hub velocity in the body frame (forward m/s, left m/s)
    /// and a wheel rate in rad/s.
    ///
    /// With the slip velocity s of the contact in the wheel's frame and the reference speed
    /// v_ref = max(|rate r|, |hub velocity|, floor), the force is
    /// friction (1 - exp(-|s| / (v_ref K))) against s. The resistance acts against the hub's motion
    /// along the wheel; the motor does not feel it.
    #[must_use]
    pub fn shear(&self, hub_m_s: (f64, f64), rate_rad_s: f64) -> Shear {
        let (cos, sin) = self.heading;
        let rolling = rate_rad_s * self.radius_m;
        let along_hub = hub_m_s.0 * cos + hub_m_s.1 * sin;
        let across = hub_m_s.1 * cos - hub_m_s.0 * sin;
        let along = along_hub - rolling;
        let slip = (along * along + across * across).sqrt() + SLIP_MIN_M_S;
        let hub = (along_hub * along_hub + across * across).sqrt();
        let reference = rolling.abs().max(hub).max(REFERENCE_MIN_M_S);
        let strength = -self.friction * (-slip / (reference * self.shear_modulus)).exp_m1();
        let (force_along, force_across) = (-strength * along / slip, -strength * across / slip);
        let mut pull = force_along;
        if self.resistance != 0.0 {
            pull -= self.resistance * resisting(along_hub);
        }
        Shear {
            x: pull * cos - force_across * sin,
            y: pull * sin + force_across * cos,
            along: force_along,
        }
    }
}
