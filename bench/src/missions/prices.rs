//! What a mission is worth: `bench/missions.toml`.

use std::collections::BTreeMap;
use std::error::Error;

use serde::Deserialize;

use super::kind::Kind;
use super::rules::Rules;

/// The file.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MissionFile {
    /// Prices, in points.
    pub prices: Prices,
    /// Share of each kind of missions.
    shares: BTreeMap<Kind, f64>,
    /// The rules that the sweep found.
    pub rules: Rules,
}

/// Prices, in points.
#[derive(Debug, Clone, Copy, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Prices {
    /// Earned for each metre of the path.
    pub progress_1_m: f64,
    /// Paid for each second.
    pub time_1_s: f64,
    /// Paid for each call for help.
    pub call: f64,
    /// Paid for each metre off the path, each second.
    pub off_path_1_m_s: f64,
    /// Paid for each metre driven with a fault.
    pub fault_1_m: FaultPrices,
    /// Paid for each metre driven with a remedy for what is not there.
    pub needless_1_m: NeedlessPrices,
}

/// Paid for each metre driven with a fault; unanswered ones at full speed.
#[derive(Debug, Clone, Copy, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FaultPrices {
    /// A stuck wheel.
    pub stuck: f64,
    /// A stuck wheel that is counter-steered for.
    pub stuck_compensated: f64,
    /// A broken encoder.
    pub encoder: f64,
    /// A broken encoder that is ignored.
    pub encoder_ignored: f64,
    /// What no model contains.
    pub unmodelled: f64,
}

/// Paid for each metre driven with a remedy for what is not there.
#[derive(Debug, Clone, Copy, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct NeedlessPrices {
    /// Counter-steering.
    pub compensation: f64,
    /// Ignoring an encoder.
    pub ignoring: f64,
}

impl MissionFile {
    /// Reads it.
    ///
    /// # Errors
    /// A file that cannot be read, or whose shares do not sum to 1.
    pub fn read() -> Result<Self, Box<dyn Error>> {
        let text = std::fs::read_to_string(crate::root().join("bench/missions.toml"))?;
        let file: Self = toml::from_str(&text)?;
        let sum: f64 = Kind::ALL.iter().map(|kind| file.share(*kind, 1.0)).sum();
        if (sum - 1.0).abs() > 1e-9 {
            return Err(format!("bench/missions.toml: the shares sum to {sum}").into());
        }
        Ok(file)
    }

    /// Share of a kind where the odds of any fault are `odds` times those of the file.
    #[must_use]
    pub fn share(&self, kind: Kind, odds: f64) -> f64 {
        let stated = |kind| self.shares.get(&kind).copied().unwrap_or(0.0);
        let nothing = stated(Kind::Nothing);
        let healthy = nothing / (nothing + odds * (1.0 - nothing));
        match kind {
            Kind::Nothing => healthy,
            _ => (1.0 - healthy) * stated(kind) / (1.0 - nothing),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shares_follow_the_odds_of_a_fault() {
        let file = MissionFile::read().unwrap();
        // 1 to 4 becomes 1 to 12, and 1 to 4/3.
        for (odds, nothing) in [(1.0, 0.2), (3.0, 1.0 / 13.0), (1.0 / 3.0, 3.0 / 7.0)] {
            let shares = Kind::ALL.map(|kind| file.share(kind, odds));
            assert!((shares[0] - nothing).abs() < 1e-12);
            assert!((shares.iter().sum::<f64>() - 1.0).abs() < 1e-12);
            // Among faults the mix stays.
            assert!((shares[1] / shares[2] - 0.25 / 0.2).abs() < 1e-12);
        }
    }
}
