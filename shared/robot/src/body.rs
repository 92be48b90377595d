//! How a robot's body follows its command.

use serde::{Deserialize, Serialize};

/// The body's response, which no log of steady driving shows. `vigil learn` copies it into the
/// model, where the lag is the centre of the range that the detector estimates.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Body {
    /// Time constant with which the body follows its command, s.
    pub lag_s: f64,
    /// Factor by which that may be wrong, either way.
    pub lag_uncertainty: f64,
    /// Commanded or driven speed below which the robot stands, m/s.
    pub standing_m_s: f64,
}

impl Default for Body {
    /// A small robot with geared motors. Chosen: a lag of a tenth of a second, to a factor of two
    /// as the load changes it; standing below a tenth of the rover's usual speed.
    fn default() -> Self {
        Self {
            lag_s: 0.1,
            lag_uncertainty: 2.0,
            standing_m_s: 0.02,
        }
    }
}

impl Body {
    /// The first number that is out of range, and its name.
    #[must_use]
    pub fn invalid(&self) -> Option<(&'static str, f64)> {
        let all = [
            ("lag_s", self.lag_s, 0.0),
            ("lag_uncertainty", self.lag_uncertainty, 1.0),
            ("standing_m_s", self.standing_m_s, 0.0),
        ];
        let mut wrong = all
            .into_iter()
            .filter(|&(_, value, least)| !(value.is_finite() && value >= least));
        wrong.next().map(|(name, value, _)| (name, value))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_number_out_of_range_is_named() {
        assert_eq!(Body::default().invalid(), None);
        let body = Body {
            lag_uncertainty: 0.5,
            ..Body::default()
        };
        assert_eq!(body.invalid(), Some(("lag_uncertainty", 0.5)));
    }
}
