//! Where the channels of pose and wheels lie in a robot's frames.

use vigil_blocks::{COMMANDS, EVIDENCE, Evidence, SensorFrame, WHEELS};

use crate::channel::{Role, channels, hash};
use crate::description::Description;
use crate::slot::{SLOTS, Slot};

/// Places of the standard channels; none for those that the robot does not have.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ChannelMap {
    hash: u64,
    command: u32,
    all: u64,
    pose: [Option<usize>; 3],
    yaw_rate: Option<usize>,
    wheel_rate: [Option<usize>; WHEELS],
    steer: [Option<usize>; WHEELS],
    current: [Option<usize>; WHEELS],
    /// Bits of the channels that are none of these.
    others: u64,
}

impl ChannelMap {
    /// The places in frames of `robot`.
    #[must_use]
    pub fn new(robot: &Description) -> Self {
        let mut map = Self {
            hash: hash(robot),
            command: (0..robot.command.len().min(COMMANDS)).fold(0, |bits, i| bits | 1 << i),
            all: 0,
            pose: [None; 3],
            yaw_rate: None,
            wheel_rate: [None; WHEELS],
            steer: [None; WHEELS],
            current: [None; WHEELS],
            others: 0,
        };
        for (place, channel) in channels(robot).iter().enumerate() {
            map.all |= 1 << place;
            let entry = match (channel.role, channel.wheel) {
                (Role::PoseX, _) => &mut map.pose[0],
                (Role::PoseY, _) => &mut map.pose[1],
                (Role::PoseYaw, _) => &mut map.pose[2],
                (Role::BodyRate, _) if channel.name == "yaw_rate" => &mut map.yaw_rate,
                (Role::WheelRate, Some(wheel)) => &mut map.wheel_rate[wheel],
                (Role::SteeringAngle, Some(wheel)) => &mut map.steer[wheel],
                (Role::Current, Some(wheel)) => &mut map.current[wheel],
                _ => {
                    map.others |= 1 << place;
                    continue;
                }
            };
            *entry = entry.or(Some(place));
        }
        map
    }

    /// Hash of the robot's channel list: what frames carry.
    #[must_use]
    pub const fn hash(&self) -> u64 {
        self.hash
    }

    /// Bits of all axes of the command, as in [`SensorFrame::command_valid`].
    #[must_use]
    pub const fn command_bits(&self) -> u32 {
        self.command
    }

    /// Bits of all channels, as in [`SensorFrame::channel_valid`].
    #[must_use]
    pub const fn channel_bits(&self) -> u64 {
        self.all
    }

    /// Bits of the pose's channels; 0 without a whole pose.
    #[must_use]
    pub fn pose_bits(&self) -> u64 {
        match self.pose {
            [Some(x), Some(y), Some(yaw)] => 1 << x | 1 << y | 1 << yaw,
            _ => 0,
        }
    }

    /// Bits of yaw rate and currents.
    #[must_use]
    pub fn further_bits(&self) -> u64 {
        let places = self.current.iter().chain([&self.yaw_rate]).flatten();
        places.fold(0, |bits, place| bits | 1 << place)
    }

    /// Pose x m, y m, yaw rad; none unless all three are measured.
    #[must_use]
    pub fn pose(&self, frame: &SensorFrame) -> Option<[f64; 3]> {
        let [x, y, yaw] = self.pose.map(|place| measured(frame, place));
        Some([x?, y?, yaw?])
    }

    /// Yaw rate, rad/s.
    #[must_use]
    pub fn yaw_rate(&self, frame: &SensorFrame) -> Option<f64> {
        measured(frame, self.yaw_rate)
    }

    /// Rate of a wheel, rad/s.
    #[must_use]
    pub fn wheel_rate(&self, frame: &SensorFrame, wheel: usize) -> Option<f64> {
        measured(frame, *self.wheel_rate.get(wheel)?)
    }

    /// Angle of a steered wheel, rad.
    #[must_use]
    pub fn steer(&self, frame: &SensorFrame, wheel: usize) -> Option<f64> {
        measured(frame, *self.steer.get(wheel)?)
    }

    /// Motor current of a wheel, A.
    #[must_use]
    pub fn current(&self, frame: &SensorFrame, wheel: usize) -> Option<f64> {
        measured(frame, *self.current.get(wheel)?)
    }

    /// Writes the pose, as far as the robot measures one.
    pub fn set_pose(&self, frame: &mut SensorFrame, pose: [f64; 3]) {
        for (place, value) in self.pose.into_iter().zip(pose) {
            set(frame, place, value);
        }
    }

    /// Writes the yaw rate, if the robot measures it.
    pub fn set_yaw_rate(&self, frame: &mut SensorFrame, value: f64) {
        set(frame, self.yaw_rate, value);
    }

    /// Writes the rate of a wheel, if the robot measures it.
    pub fn set_wheel_rate(&self, frame: &mut SensorFrame, wheel: usize, value: f64) {
        set(frame, self.wheel_rate.get(wheel).copied().flatten(), value);
    }

    /// Writes the angle of a wheel, if the robot measures it.
    pub fn set_steer(&self, frame: &mut SensorFrame, wheel: usize, value: f64) {
        set(frame, self.steer.get(wheel).copied().flatten(), value);
    }

    /// Writes the current of a wheel, if the robot measures it.
    pub fn set_current(&self, frame: &mut SensorFrame, wheel: usize, value: f64) {
        set(frame, self.current.get(wheel).copied().flatten(), value);
    }

    /// Place of a slot's evidence in a belief; none for what the robot does not have.
    #[must_use]
    pub fn evidence_place(&self, slot: usize) -> Option<usize> {
        match slot {
            Slot::POSE => Some(Evidence::POSE),
            Slot::ANY => Some(Evidence::ANY),
            Slot::YAW_RATE => self.yaw_rate,
            8..16 => self.wheel_rate[slot - 8],
            16..24 => self.steer[slot - 16],
            24..32 => self.current[slot - 24],
            32..SLOTS => Some(slot - 32).filter(|place| self.others >> place & 1 == 1),
            _ => None,
        }
    }

    /// Evidence by slot as a belief carries it; `none` where the robot has no such slot.
    #[must_use]
    pub fn to_evidence(&self, slots: &[f64; SLOTS], none: f64) -> [f64; EVIDENCE] {
        let mut out = [none; EVIDENCE];
        for (slot, value) in slots.iter().enumerate() {
            if let Some(place) = self.evidence_place(slot) {
                out[place] = *value;
            }
        }
        out
    }

    /// Evidence by slot, from a belief; `none` for slots that the robot does not have.
    #[must_use]
    pub fn from_evidence(&self, evidence: &[f64; EVIDENCE], none: f64) -> [f64; SLOTS] {
        let value = |slot| self.evidence_place(slot).map(|place| evidence[place]);
        std::array::from_fn(|slot| value(slot).unwrap_or(none))
    }
}

fn measured(frame: &SensorFrame, place: Option<usize>) -> Option<f64> {
    place.and_then(|place| frame.measured(place))
}

fn set(frame: &mut SensorFrame, place: Option<usize>, value: f64) {
    if let Some(place) = place {
        frame.set_channel(place, value);
    }
}
