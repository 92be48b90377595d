//! Prior rates at which faults begin and end.

use serde::{Deserialize, Serialize};

/// Prior rates of faults, per second of motion: at rest nothing changes them. They are assumed,
/// since no log is long enough to learn them, and decide only while the measurements do not.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct FaultPrior {
    /// The first fault, once the detector suspects one, 1/s. The rate over a robot's life would
    /// make the diagnosis slow without making it more often right.
    pub suspected_1_s: f64,
    /// A further fault of a robot whose motion shows one already, 1/s; at most the first one's
    /// rate.
    pub further_1_s: f64,
    /// Rate at which a fault ends, 1/s.
    pub mended_1_s: f64,
    /// Rate at which the fault of an alarm returns once it has ended, 1/s.
    pub again_1_s: f64,
}

impl Default for FaultPrior {
    fn default() -> Self {
        Self {
            // Chosen: its logarithm is the delay; a rate of once an hour costs 3.6 nats more.
            suspected_1_s: 0.01,
            // Chosen: one an hour.
            further_1_s: 1.0 / 3600.0,
            // Chosen: after five minutes, as loose contacts and stones do.
            mended_1_s: 1.0 / 300.0,
            // Chosen: an intermittent fault, in a quarter of an hour.
            again_1_s: 1e-3,
        }
    }
}

impl FaultPrior {
    /// The first rate that is out of range, and its name.
    #[must_use]
    pub fn invalid(&self) -> Option<(&'static str, f64)> {
        let all = [
            ("suspected_1_s", self.suspected_1_s),
            ("further_1_s", self.further_1_s),
            ("mended_1_s", self.mended_1_s),
            ("again_1_s", self.again_1_s),
        ];
        all.into_iter()
            .find(|&(_, rate)| !(rate > 0.0 && rate <= 1.0))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_rate_out_of_range_is_named() {
        assert_eq!(FaultPrior::default().invalid(), None);
        for rate in [0.0, -1.0, 1.1, f64::NAN] {
            let prior = FaultPrior {
                mended_1_s: rate,
                ..FaultPrior::default()
            };
            let found = prior.invalid().map(|(name, _)| name);
            assert_eq!(found, Some("mended_1_s"), "{rate}");
        }
    }
}
