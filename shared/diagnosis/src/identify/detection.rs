//! What the identifier takes of the detector's belief.

use vigil_blocks::DetectionBelief;
use vigil_checkpoint::CheckpointValue;
use vigil_robot::learned::{NoiseScales, OutlierRates};
use vigil_robot::{ChannelMap, DetectorAlarm, Suspects};

use crate::identify::onset_sight::OnsetSight;

/// The last detection that counts.
#[derive(Debug, Clone, Copy, Default, CheckpointValue)]
pub struct Detection {
    /// The detector's alarm.
    pub alarm: DetectorAlarm,
    /// The channels in which a fault is suspected.
    pub suspects: Suspects,
    /// How noisy the sensors are.
    pub noise: NoiseScales,
    sight: OnsetSight,
}

impl Detection {
    /// Goes on in this run, with nothing known but an alarm that stands in it.
    pub fn begin_run(&mut self, run_id: u64) {
        self.alarm.begin_run(run_id);
        *self = Self {
            alarm: self.alarm,
            ..Self::default()
        };
        // What stands on was there before.
        if self.alarm.stands() {
            self.sight.take(true);
        }
    }

    /// Takes the next belief, unless an alarm is held against it. Scales and rates beyond what a
    /// detector reports are those of a good sensor. Chosen: a scale of 0.1 and less or 100 and
    /// more, a rate of a half and more.
    pub fn take(&mut self, belief: &DetectionBelief, map: &ChannelMap) {
        let is_news = self.alarm.take(belief);
        self.sight.take(self.alarm.stands());
        if !is_news {
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
        let channels = map.from_evidence(&belief.channel_log_odds, f64::NEG_INFINITY);
        self.suspects = Suspects::new(self.alarm.stands(), &channels);
        self.noise = NoiseScales {
            pose: belief.noise_scale.map(scale),
            wheels: belief.noise_scale_wheels.map(scale),
            steer: belief.noise_scale_steer.map(scale),
            outliers: OutlierRates {
                pose: belief.outlier_rate.map(rate),
                wheels: belief.outlier_rate_wheels.map(rate),
                steer: belief.outlier_rate_steer.map(rate),
            },
        };
    }

    /// So much motion was observed.
    pub fn pass(&mut self, moved_s: f64) {
        self.sight.pass(moved_s);
    }

    /// True if the robot has moved long enough without an alarm to have been whole.
    pub fn has_seen_quiet(&self) -> bool {
        self.sight.has_seen_quiet()
    }

    /// True if what was found is to be told, faults with a name (`are_named`) or anything else. Who
    /// has not seen how an alarm began finds the robot neither healthy nor inexplicable before it
    /// has seen enough.
    pub fn may_tell(&self, are_named: bool) -> bool {
        are_named || !self.sight.is_short()
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
        let alarm = found.alarm;
        assert_eq!(
            (alarm.stands(), alarm.t_ns(), alarm.p_fault()),
            (true, 7, 0.3)
        );
        assert!(!detection(&DetectionBelief::default()).alarm.stands());
    }

    #[test]
    fn who_begins_beside_an_alarm_tells_of_faults_alone_before_it_has_seen_enough() {
        let map = map();
        let mut found = Detection::default();
        assert!(found.may_tell(false));
        let belief = DetectionBelief {
            alarm: 1,
            ..DetectionBelief::default()
        };
        for (moved_s, may) in [(0.0, false), (2.5, false), (0.5, true)] {
            found.take(&belief, &map);
            found.pass(moved_s);
            assert_eq!(found.may_tell(false), may);
            assert!(found.may_tell(true), "a fault is told at once");
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
        belief.noise_scale[0] = 3.0;
        found.take(&belief, &map);
        let mut fresh = DetectionBelief::default();
        fresh.header.epoch = 2;
        found.take(&fresh, &map);
        assert!(found.alarm.is_held());
        assert_eq!((found.alarm.p_fault(), found.noise.pose[0]), (0.9, 3.0));
        found.begin_run(0);
        assert_eq!((found.alarm.stands(), found.noise.pose[0]), (true, 1.0));
        found.begin_run(5);
        assert!(!found.alarm.stands());
    }
}
