//! Sensor frames: joints, odometry, and every channel by its name.

use vigil_blocks::SensorFrame;
use vigil_robot::Description;
use vigil_robot::channel::{Channel, Role, channels, hash};

use super::Outcome;
use crate::message_times::MessageTimes;
use crate::messages::header::{Header, Stamp};
use crate::messages::joint_state::JointState;
use crate::messages::odometry::{Odometry, PlanarTwist};
use crate::messages::pose::PlanarPose;
use crate::messages::transform::Transform;
use crate::sink::Sink;
use crate::topics;

/// Frames by the convention of ROS: the pose's, and the robot's.
const ODOM: &str = "odom";
const BASE: &str = "base_link";

/// A joint that a channel measures: a wheel's rate, or a steering angle.
struct Joint {
    place: usize,
    is_rate: bool,
}

/// Names of a frame's numbers.
pub(crate) struct FrameTranslation {
    robot_hash: u64,
    channels: Vec<String>,
    axes: Vec<String>,
    joints: Vec<Joint>,
    joint_names: Vec<String>,
    /// Places of x, y and yaw.
    pose: Option<[usize; 3]>,
    yaw_rate: Option<usize>,
}

/// A wheel has the name of the wheel, a steering joint that of its channel.
fn joint_name(channel: &Channel, robot: &Description) -> String {
    let wheel = channel.wheel.and_then(|at| robot.wheels.get(at));
    match (channel.role, wheel) {
        (Role::WheelRate, Some(wheel)) => wheel.name.clone(),
        _ => channel.name.clone(),
    }
}

impl FrameTranslation {
    pub(crate) fn new(robot: &Description) -> Self {
        let all = channels(robot);
        let place = |role: Role| all.iter().position(|channel| channel.role == role);
        let pose = || {
            Some([
                place(Role::PoseX)?,
                place(Role::PoseY)?,
                place(Role::PoseYaw)?,
            ])
        };
        let is_joint =
            |channel: &Channel| [Role::WheelRate, Role::SteeringAngle].contains(&channel.role);
        let joints = || all.iter().enumerate().filter(|(_, it)| is_joint(it));
        Self {
            robot_hash: hash(robot),
            channels: all.iter().map(|channel| channel.name.clone()).collect(),
            axes: robot.command.iter().map(|axis| axis.name.clone()).collect(),
            joint_names: joints()
                .map(|(_, channel)| joint_name(channel, robot))
                .collect(),
            joints: joints()
                .map(|(place, channel)| Joint {
                    place,
                    is_rate: channel.role == Role::WheelRate,
                })
                .collect(),
            pose: pose(),
            // Other rates of the body may be about other axes.
            yaw_rate: all.iter().position(|channel| channel.name == "yaw_rate"),
        }
    }

    /// Writes what a frame says.
    pub(crate) fn write<S: Sink>(
        &self,
        frame: &SensorFrame,
        times: MessageTimes,
        sink: &mut S,
    ) -> Result<Outcome, S::Error> {
        if frame.robot_hash != self.robot_hash {
            return Ok(Outcome::OtherModels);
        }
        let at_ns = times.capture_ns;
        let measured = |place: usize| frame.measured(place).unwrap_or(f64::NAN);
        let values: Vec<f64> = (0..self.channels.len()).map(measured).collect();
        if !values.is_empty() {
            let state = JointState::named(at_ns, &self.channels, &values);
            sink.write(&topics::CHANNELS, times, &state)?;
        }
        let commanded = |axis: usize| frame.commanded(axis).unwrap_or(f64::NAN);
        let values: Vec<f64> = (0..self.axes.len()).map(commanded).collect();
        if !values.is_empty() {
            let state = JointState::named(at_ns, &self.axes, &values);
            sink.write(&topics::COMMAND, times, &state)?;
        }
        self.write_joints(frame, times, sink)?;
        self.write_pose(frame, times, sink)?;
        Ok(Outcome::Messages)
    }

    fn write_joints<S: Sink>(
        &self,
        frame: &SensorFrame,
        times: MessageTimes,
        sink: &mut S,
    ) -> Result<(), S::Error> {
        if self.joints.is_empty() {
            return Ok(());
        }
        let values = |of_rates: bool| -> Vec<f64> {
            let value = |joint: &Joint| {
                let measured = frame.measured(joint.place);
                let measured = measured.filter(|_| joint.is_rate == of_rates);
                measured.unwrap_or(f64::NAN)
            };
            self.joints.iter().map(value).collect()
        };
        let state = JointState {
            header: Header::at(times.capture_ns),
            names: &self.joint_names,
            positions: &values(false),
            velocities: &values(true),
        };
        sink.write(&topics::JOINT_STATES, times, &state)
    }

    /// A pose that is not measured is left out: viewers cannot show it.
    fn write_pose<S: Sink>(
        &self,
        frame: &SensorFrame,
        times: MessageTimes,
        sink: &mut S,
    ) -> Result<(), S::Error> {
        let finite = |place: usize| frame.measured(place).filter(|value| value.is_finite());
        let pose = || {
            let [x, y, yaw] = self.pose?;
            Some(PlanarPose {
                x: finite(x)?,
                y: finite(y)?,
                yaw: finite(yaw)?,
            })
        };
        let Some(pose) = pose() else {
            return Ok(());
        };
        let header = Header {
            stamp: Stamp {
                unix_ns: times.capture_ns,
            },
            frame: ODOM,
        };
        let transform = Transform {
            header,
            child: BASE,
            pose,
        };
        sink.write(&topics::TF, times, &transform)?;
        let odometry = Odometry {
            header,
            child: BASE,
            pose,
            twist: PlanarTwist {
                linear: None,
                yaw_rate: self.yaw_rate.and_then(finite),
            },
        };
        sink.write(&topics::ODOM, times, &odometry)
    }
}
