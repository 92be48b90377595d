//! Shear force between a wheel and the soil: the law of Janosi and Hanamoto (1961), with the
//! relative slip in place of the shear displacement.

/// Speed below which a resisting force changes its sign smoothly, m/s. Chosen: half of the speed at
/// which the rover counts as standing; at 0 Newton's method meets a step.
pub(super) const RESISTANCE_SMOOTHING_M_S: f64 = 0.01;
/// Added to the slip speed, m/s, so that the force has a direction at no slip. Chosen: far below
/// any slip that moves the rover.
const SLIP_MIN_M_S: f64 = 1e-9;
/// Least reference speed that makes slip relative, m/s. Chosen below the slowest speed that models
/// learn from, 0.1 m/s; at 0 the force would jump at rest.
const REFERENCE_MIN_M_S: f64 = 0.03;

/// One wheel as the soil sees it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Contact {
    /// Direction of the wheel's plane.
    pub heading: Heading,
    /// Radius of the wheel, m.
    pub radius_m: f64,
    /// Friction coefficient.
    pub friction: f64,
    /// Shear modulus (relative slip).
    pub shear_modulus: f64,
    /// Resistance of the soil to rolling, force per unit of load.
    pub resistance: f64,
}

/// Direction of a wheel's plane in the body frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Heading {
    /// Cosine of the steering angle.
    pub cos: f64,
    /// Sine of the steering angle.
    pub sin: f64,
}

/// Velocity of a wheel's hub in the body frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct HubVelocity {
    /// Forward, m/s.
    pub forward_m_s: f64,
    /// Left, m/s.
    pub left_m_s: f64,
}

impl HubVelocity {
    /// The same and `step_m_s` more forward.
    pub(super) fn faster_forward(mut self, step_m_s: f64) -> Self {
        self.forward_m_s += step_m_s;
        self
    }

    /// The same and `step_m_s` more to the left.
    pub(super) fn faster_left(mut self, step_m_s: f64) -> Self {
        self.left_m_s += step_m_s;
        self
    }
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
    /// Force per unit of load for a hub velocity and a wheel rate in rad/s.
    ///
    /// With the slip velocity s of the contact in the wheel's frame and the reference speed
    /// v_ref = max(|rate r|, |hub velocity|, floor), the force is
    /// friction (1 - exp(-|s| / (v_ref K))) against s. The resistance acts against the hub's motion
    /// along the wheel; the motor does not feel it.
    #[must_use]
    pub fn shear(&self, hub: HubVelocity, rate_rad_s: f64) -> Shear {
        let Heading { cos, sin } = self.heading;
        let rolling = rate_rad_s * self.radius_m;
        let along_hub = hub.forward_m_s * cos + hub.left_m_s * sin;
        let across = hub.left_m_s * cos - hub.forward_m_s * sin;
        let along = along_hub - rolling;
        let slip = (along * along + across * across).sqrt() + SLIP_MIN_M_S;
        let hub_m_s = (along_hub * along_hub + across * across).sqrt();
        let reference = rolling.abs().max(hub_m_s).max(REFERENCE_MIN_M_S);
        let strength = -self.friction * (-slip / (reference * self.shear_modulus)).exp_m1();
        let (force_along, force_across) = (-strength * along / slip, -strength * across / slip);
        let mut pull = force_along;
        if self.resistance != 0.0 {
            pull -= self.resistance * (along_hub / RESISTANCE_SMOOTHING_M_S).tanh();
        }
        Shear {
            x: pull * cos - force_across * sin,
            y: pull * sin + force_across * cos,
            along: force_along,
        }
    }
}
