//! What the identifier takes of the detector's belief.

use vigil_blocks::DetectionBelief;
use vigil_checkpoint::CheckpointValue;
use vigil_robot::learned::{NoiseScales, OutlierRates};
use vigil_robot::{ChannelMap, Suspects};

/// The last detection.
#[derive(Debug, Clone, Copy, Default, CheckpointValue)]
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
    /// What a belief says. Scales and rates beyond what a detector reports are those of a good
    /// sensor. Chosen: a scale of 0.1 and less or 100 and more, a rate of a half and more.
    pub fn from_belief(belief: &DetectionBelief, map: &ChannelMap) -> Self {
        let scale = |scale: f64| match scale > 0.1 && scale < 100.0 {
            true => scale,
            false => 1.0,
        };
        let rate = |rate: f64| match rate > 0.0 && rate < 0.5 {
            true => rate,
            false => OutlierRates::default().pose[0],
        };
        let alarm = belief.alarm != 0;
        let channels = map.from_evidence(&belief.channel_log_odds, f64::NEG_INFINITY);
        Self {
            alarm,
            suspects: Suspects::new(alarm, &channels),
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

#[cfg(test)]
mod tests {
    use super::*;

    fn map() -> ChannelMap {
        let path = concat!(
            env!("CARGO_MANIFEST_DIR"),
            "/../../config/robots/rover.toml"
        );
        let robot = vigil_setup::load_robot(path.as_ref());
        ChannelMap::new(&robot.unwrap_or_else(|error| panic!("{error}")))
    }

    #[test]
    fn scales_and_rates_that_no_detector_reports_are_those_of_a_good_sensor() {
        let good = OutlierRates::default().pose[0];
        for (scale, used) in [
            (0.1, 1.0),
            (0.2, 0.2),
            (99.0, 99.0),
            (100.0, 1.0),
            (f64::NAN, 1.0),
        ] {
            let mut belief = DetectionBelief::default();
            belief.noise_scale[1] = scale;
            belief.noise_scale_wheels[2] = scale;
            belief.noise_scale_steer[3] = scale;
            let noise = Detection::from_belief(&belief, &map()).noise;
            assert_eq!([noise.pose[1], noise.wheels[2], noise.steer[3]], [used; 3]);
        }
        for (rate, used) in [(0.0, good), (0.2, 0.2), (0.5, good), (f64::NAN, good)] {
            let mut belief = DetectionBelief::default();
            belief.outlier_rate[1] = rate;
            belief.outlier_rate_wheels[2] = rate;
            belief.outlier_rate_steer[3] = rate;
            let rates = Detection::from_belief(&belief, &map()).noise.outliers;
            assert_eq!([rates.pose[1], rates.wheels[2], rates.steer[3]], [used; 3]);
        }
    }

    #[test]
    fn the_alarm_and_its_time_are_taken_as_they_are() {
        let belief = DetectionBelief {
            alarm: 1,
            alarm_t_capture_ns: 7,
            p_fault: 0.3,
            ..DetectionBelief::default()
        };
        let found = Detection::from_belief(&belief, &map());
        assert_eq!((found.alarm, found.t_ns, found.p_fault), (true, 7, 0.3));
        assert!(!Detection::from_belief(&DetectionBelief::default(), &map()).alarm);
    }
}
