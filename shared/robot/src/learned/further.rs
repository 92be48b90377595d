//! Channels beyond pose and encoders: the gyro's yaw rate and the motors' currents. What was
//! learned of them, and what one observation holds of them.

use serde::{Deserialize, Serialize};
use vigil_blocks::{SensorFrame, WHEELS};
use vigil_checkpoint::CheckpointValue;

use super::Reading;
use crate::channel_map::ChannelMap;
use crate::frame_guard::CURRENT_MAX_A;
use crate::model_file::{ModelError, check_range, refuse};

/// Below this rate the dry friction of a bearing turns round, rad/s: an encoder's noise.
const DRY_RAD_S: f64 = 0.05;
/// Yaw rates beyond this are no measurement, rad/s.
const YAW_RATE_MAX_RAD_S: f64 = 1e3;

/// What was learned of the further channels: those that the frames held.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FurtherModel {
    /// File of the frames.
    pub frames_file: String,
    /// Hash over the runs learned from.
    pub data_hash: String,
    /// Their ids: healthy from beginning to end.
    pub runs: Vec<u32>,
    /// The gyro's yaw rate beside that of the pose.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub yaw_rate: Option<YawRateModel>,
    /// The motors' currents.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub currents: Option<CurrentsModel>,
}

/// The gyro.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct YawRateModel {
    /// Noise per sample at the reference rate, rad/s.
    pub noise_rad_s: f64,
    /// Probability that a healthy sample equals its predecessor bit for bit.
    pub repeat_rate: f64,
}

/// The motors' currents.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CurrentsModel {
    /// Noise per sample at the reference rate, A.
    pub noise_a: f64,
    /// Probability that a healthy sample equals its predecessor bit for bit.
    pub repeat_rate: f64,
    /// One per wheel.
    pub wheels: Vec<CurrentModel>,
}

/// Current of one motor in healthy driving on level ground.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CurrentModel {
    /// What it draws in the direction in which it turns, whatever its rate, A: a polynomial of the
    /// curvature, κ^0 to κ^2. Dry friction of the bearing, and scrub, which depends on relative
    /// slip.
    pub dry_a: [f64; 3],
    /// What it draws besides, by its rate, A s/rad: viscous friction of the bearing.
    pub viscous_a_s_rad: f64,
    /// Standard deviation by the ground, sensor noise excluded, A.
    pub sd_a: f64,
}

impl CurrentModel {
    /// What its terms count for in a wheel that would roll at `rolling_rad_s`.
    #[must_use]
    pub fn basis(rolling_rad_s: f64, curvature: f64) -> [f64; 4] {
        let with = (rolling_rad_s / DRY_RAD_S).clamp(-1.0, 1.0);
        [
            with,
            with * curvature,
            with * curvature * curvature,
            rolling_rad_s,
        ]
    }

    /// Current of a wheel that would roll at `rolling_rad_s`, A.
    #[must_use]
    pub fn current_a(&self, rolling_rad_s: f64, curvature: f64) -> f64 {
        let [constant, linear, square, rate] = Self::basis(rolling_rad_s, curvature);
        let [a, b, c] = self.dry_a;
        a * constant + b * linear + c * square + self.viscous_a_s_rad * rate
    }
}

impl FurtherModel {
    /// Checks its numbers for a robot of so many wheels.
    pub(super) fn check(&self, wheels: usize) -> Result<(), ModelError> {
        if let Some(gyro) = &self.yaw_rate {
            check_range("further.yaw_rate.noise_rad_s", gyro.noise_rad_s, 1e-9, 10.0)?;
            let repeat_rate = gyro.repeat_rate;
            check_range("further.yaw_rate.repeat_rate", repeat_rate, 1e-9, 0.9)?;
        }
        let Some(currents) = &self.currents else {
            return Ok(());
        };
        check_range("further.currents.noise_a", currents.noise_a, 1e-9, 1e3)?;
        let repeat_rate = currents.repeat_rate;
        check_range("further.currents.repeat_rate", repeat_rate, 1e-9, 0.9)?;
        let found = currents.wheels.len();
        if found != wheels {
            return refuse("further.currents.wheels", found, "one entry per wheel");
        }
        for wheel in &currents.wheels {
            for term in wheel.dry_a.into_iter().chain([wheel.viscous_a_s_rad]) {
                check_range("further.currents.wheels", term, -1e3, 1e3)?;
            }
            check_range("further.currents.wheels.sd_a", wheel.sd_a, 0.0, 1e3)?;
        }
        Ok(())
    }
}

/// What one observation holds of the further channels.
#[derive(Debug, Clone, Copy, PartialEq, Default, CheckpointValue)]
pub struct Further {
    /// Yaw rate, rad/s.
    pub yaw_rate: Reading,
    /// Motor currents, A.
    pub currents: [Reading; WHEELS],
}

/// Collects them, frame by frame.
#[derive(Debug, Clone, Default, CheckpointValue)]
pub(super) struct Collector {
    last: (Option<f64>, [Option<f64>; WHEELS]),
    sums: Further,
    /// Of the last completed observation.
    pub found: Further,
}

impl Collector {
    /// Takes a frame; true if a channel is no measurement.
    pub fn take(&mut self, frame: &SensorFrame, map: &ChannelMap) -> bool {
        let mut invalid = false;
        let mut push =
            |value: Option<f64>, most, sum: &mut Reading, last: &mut Option<f64>| match value {
                Some(value) if value.abs() <= most => sum.push(value, last.replace(value)),
                Some(_) => invalid = true,
                None => {}
            };
        let (sums, (gyro, currents)) = (&mut self.sums, &mut self.last);
        let rate = map.yaw_rate(frame);
        push(rate, YAW_RATE_MAX_RAD_S, &mut sums.yaw_rate, gyro);
        for (i, last) in currents.iter_mut().enumerate() {
            let (current, sum) = (map.current(frame, i), &mut sums.currents[i]);
            push(current, CURRENT_MAX_A, sum, last);
        }
        invalid
    }

    /// What was collected is no whole observation: it is dropped.
    pub(crate) fn drop_frames(&mut self) {
        self.sums = next(&self.sums);
    }

    /// An observation is complete.
    pub fn complete(&mut self) {
        self.found = self.sums;
        self.drop_frames();
    }
}

fn next(sums: &Further) -> Further {
    Further {
        yaw_rate: sums.yaw_rate.next(),
        currents: sums.currents.each_ref().map(Reading::next),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::description::Description;

    const ROVER: &str = include_str!("../../../../config/robots/rover.toml");

    #[test]
    fn dry_friction_turns_round_with_the_wheel_and_viscous_grows_with_its_rate() {
        let model = CurrentModel {
            dry_a: [0.04, 0.01, -0.02],
            viscous_a_s_rad: 0.04,
            sd_a: 0.0,
        };
        let forward = model.current_a(2.5, 0.5);
        assert!((forward - (0.04 + 0.005 - 0.005 + 0.1)).abs() < 1e-15);
        assert_eq!(model.current_a(-2.5, 0.5), -forward);
        assert_eq!(model.current_a(0.0, 0.5), 0.0);
    }

    #[test]
    fn each_channel_is_read_where_it_is_valid() {
        let mut collector = Collector::default();
        let robot: Description = toml::from_str(ROVER).unwrap_or_else(|error| panic!("{error}"));
        let map = ChannelMap::new(&robot);
        let mut frame = SensorFrame::default();
        map.set_yaw_rate(&mut frame, 0.25);
        map.set_current(&mut frame, 1, 7.0);
        assert!(!collector.take(&frame, &map));
        map.set_yaw_rate(&mut frame, f64::NAN);
        assert!(collector.take(&frame, &map));
        collector.complete();
        let found = collector.found;
        assert_eq!((found.yaw_rate.plain, found.yaw_rate.mean), (1, 0.25));
        let counts = found.currents.map(|current| current.count());
        assert_eq!(counts, [0, 2, 0, 0, 0, 0, 0, 0]);
        assert_eq!(found.currents[1].repeats, 1);
    }
}
