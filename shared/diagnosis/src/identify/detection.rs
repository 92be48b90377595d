//! What the identifier takes of the detector's belief.

use vigil_blocks::DetectionBelief;
use vigil_robot::Suspects;
use vigil_robot::learned::{NoiseScales, OutlierRates};

/// The last detection.
#[derive(Debug, Clone, Copy, Default)]
pub struct Detection {
    /// Whether the alarm stands.
    pub alarm: bool,
    /// Since when, capture time ns.
    pub t_ns: u64,
    /// The channels in which a fault is suspected.
    pub suspects: Suspects,
    /// Probability of a fault.
    pub p_fault: f64,
    /// How noisy the sensors are.
    pub noise: NoiseScales,
}

impl Detection {
    /// What a belief says; scales and rates that no detector reports are those of a good sensor.
    pub fn from_belief(belief: &DetectionBelief) -> Self {
        let scale = |scale: f64| match scale > 0.1 && scale < 100.0 {
            true => scale,
            false => 1.0,
        };
        let rate = |rate: f64| match rate > 0.0 && rate < 0.5 {
            true => rate,
            false => OutlierRates::default().pose[0],
        };
        let alarm = belief.alarm != 0;
        Self {
            alarm,
            suspects: Suspects::new(alarm, &belief.channel_log_odds),
            t_ns: belief.alarm_t_capture_ns,
            p_fault: belief.p_fault,
            noise: NoiseScales {
                pose: belief.noise_scale.map(scale),
                wheels: belief.noise_scale_wheels.map(scale),
                steer: belief.noise_scale_steer.map(scale),
                outliers: OutlierRates {
                    pose: belief.outlier_rate.map(rate),
                    wheels: belief.outlier_rate_wheels.map(rate),
                    steer: belief.outlier_rate_steer.map(rate),
                },
            },
        }
    }
}
