//! What the identifier takes of the detector's belief.

use vigil_blocks::DetectionBelief;
use vigil_checkpoint::CheckpointValue;
use vigil_robot::learned::{NoiseScales, OutlierRates};
use vigil_robot::{ChannelMap, DetectorSuccession, Suspects};

/// The last detection that counts.
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
    succession: DetectorSuccession,
    has_begun: bool,
    /// The alarm stood already at the first detection of the run.
    missed_onset: bool,
}

impl Detection {
    /// Takes the next belief, unless the alarm of a detector before stands. Scales and rates beyond
    /// what a detector reports are those of a good sensor. Chosen: a scale of 0.1 and less or 100
    /// and more, a rate of a half and more.
    pub fn take(&mut self, belief: &DetectionBelief, map: &ChannelMap) {
        if !self.succession.counts(belief) {
            return;
        }
        let scale = |scale: f64| match scale > 0.1 && scale < 100.0 {
            true => scale,
            false => 1.0,
        };
        let rate = |rate: f64| match rate > 0.0 && rate < 0.5 {
            true => rate,
            false => OutlierRates::default().pose[0],
        };
        let alarm = belief.alarm != 0;
        let is_first = !self.has_begun;
        let channels = map.from_evidence(&belief.channel_log_odds, f64::NEG_INFINITY);
        *self = Self {
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
            succession: self.succession,
            has_begun: true,
            missed_onset: alarm && (is_first || self.missed_onset),
        };
    }

    /// How probable it is at most that nothing is wrong: who has not seen how an alarm began
    /// believes the detector.
    pub fn p_nominal_max(&self) -> f64 {
        match self.missed_onset {
            true => 1.0 - self.p_fault.clamp(0.0, 1.0),
            false => 1.0,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn detection(belief: &DetectionBelief) -> Detection {
        let mut detection = Detection::default();
        detection.take(belief, &map());
        detection
    }

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
            let noise = detection(&belief).noise;
            assert_eq!([noise.pose[1], noise.wheels[2], noise.steer[3]], [used; 3]);
        }
        for (rate, used) in [(0.0, good), (0.2, 0.2), (0.5, good), (f64::NAN, good)] {
            let mut belief = DetectionBelief::default();
            belief.outlier_rate[1] = rate;
            belief.outlier_rate_wheels[2] = rate;
            belief.outlier_rate_steer[3] = rate;
            let rates = detection(&belief).noise.outliers;
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
        let found = detection(&belief);
        assert_eq!((found.alarm, found.t_ns, found.p_fault), (true, 7, 0.3));
        assert!(!detection(&DetectionBelief::default()).alarm);
    }

    #[test]
    fn who_begins_beside_an_alarm_believes_the_detector_until_it_falls() {
        let map = map();
        let belief = |alarm, p_fault| DetectionBelief {
            alarm,
            p_fault,
            ..DetectionBelief::default()
        };
        let mut found = Detection::default();
        assert_eq!(found.p_nominal_max(), 1.0);
        for (alarm, p_fault, p_max) in [
            (1, 0.75, 0.25),
            (1, f64::INFINITY, 0.0),
            (0, 0.5, 1.0),
            (1, 0.75, 1.0),
        ] {
            found.take(&belief(alarm, p_fault), &map);
            assert_eq!(found.p_nominal_max(), p_max);
        }
    }

    #[test]
    fn a_detector_that_has_just_begun_does_not_end_the_alarm_of_the_one_before() {
        let map = map();
        let mut found = Detection::default();
        let mut belief = DetectionBelief {
            alarm: 1,
            p_fault: 0.9,
            ..DetectionBelief::default()
        };
        belief.header.epoch = 1;
        found.take(&belief, &map);
        let mut fresh = DetectionBelief::default();
        fresh.header.epoch = 2;
        found.take(&fresh, &map);
        assert_eq!((found.alarm, found.p_fault), (true, 0.9));
        fresh.run_id = 5;
        found.take(&fresh, &map);
        assert!(!found.alarm);
    }
}
