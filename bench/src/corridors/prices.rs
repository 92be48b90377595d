//! What a mission in a corridor is worth: `bench/corridors.toml`.

use std::error::Error;

use serde::Deserialize;

use super::ladder::EscalationSettings;

/// The file.
#[derive(Debug, Clone, Copy, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CorridorFile {
    /// Prices, in points.
    pub prices: CorridorPrices,
    /// The rule that the sweep found.
    pub ladder: EscalationSettings,
}

/// Prices, in points.
#[derive(Debug, Clone, Copy, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CorridorPrices {
    /// Earned at the goal.
    pub goal: f64,
    /// Paid for each second.
    pub time_1_s: f64,
    /// Paid for each call for help.
    pub call: f64,
    /// Paid for each time that the robot runs into something.
    pub touch: f64,
    /// Paid for each metre with a wrong pose.
    pub lost_1_m: f64,
}

impl CorridorFile {
    /// Reads it.
    ///
    /// # Errors
    /// A file that cannot be read.
    pub fn read() -> Result<Self, Box<dyn Error>> {
        let text = std::fs::read_to_string(crate::root().join("bench/corridors.toml"))?;
        Ok(toml::from_str(&text)?)
    }
}
