//! Angles on the circle.

use std::f64::consts::{PI, TAU};

/// `angle` (rad) moved by whole turns into ±π. Not finite stays not finite.
#[must_use]
pub fn wrap(angle: f64) -> f64 {
    // The usual case, without a call to round.
    if angle.abs() < PI {
        return angle;
    }
    angle - TAU * (angle / TAU).round()
}

#[cfg(test)]
mod tests {
    use super::wrap;
    use std::f64::consts::PI;

    #[test]
    fn whole_turns_vanish() {
        for (angle, expected) in [(0.0, 0.0), (1.5 * PI, -0.5 * PI), (-7.0, -7.0 + 2.0 * PI)] {
            assert!((wrap(angle) - expected).abs() < 1e-12, "{angle}");
        }
    }
}
