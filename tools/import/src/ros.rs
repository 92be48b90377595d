//! ROS 2 messages in recordings: the fields of a topic's messages as columns.
//!
//! | message | columns |
//! |---|---|
//! | `nav_msgs/msg/Odometry` | `pose.x`, `pose.y`, `pose.yaw`, and those of a twist |
//! | `sensor_msgs/msg/JointState` | `position[NAME]`, `velocity[NAME]`, `effort[NAME]` |
//! | `geometry_msgs/msg/Twist`, `TwistStamped` | `linear.x`, `linear.y`, `angular.z`, `curvature` |
//! | `sensor_msgs/msg/Imu` | `angular_velocity.z`, `yaw` |
//! | all | `log_time`: when recorded, ns; `stamp`: when measured, without a header the same |
//!
//! `curvature` is the yaw rate over the forward speed, 0 at rest.

use std::path::{Path, PathBuf};

use byteorder::{BigEndian, LittleEndian};
use serde::Deserialize;
use serde::de::DeserializeOwned;
use vigil_recording::table::wrong_row;

use super::ImportError;
use super::bag::{self, BagMessage, CutBag};

/// Forward speed below which a twist has no curvature, m/s.
const REST_M_S: f64 = 1e-3;

#[derive(Debug, Clone, Copy, Deserialize)]
struct Time {
    /// Seconds.
    sec: i32,
    /// Nanoseconds besides.
    nanosec: u32,
}

#[derive(Debug, Clone, Deserialize)]
struct Header {
    /// When it was measured.
    stamp: Time,
    /// Frame of its poses.
    #[serde(rename = "frame_id")]
    _frame_id: String,
}

#[derive(Debug, Clone, Copy, Deserialize)]
struct Vector {
    /// Forward.
    x: f64,
    /// Left.
    y: f64,
    /// Up.
    z: f64,
}

#[derive(Debug, Clone, Copy, Deserialize)]
struct Quaternion {
    /// Imaginary part.
    x: f64,
    /// Imaginary part.
    y: f64,
    /// Imaginary part.
    z: f64,
    /// Real part.
    w: f64,
}

#[derive(Debug, Clone, Copy, Deserialize)]
struct Pose {
    /// m.
    position: Vector,
    /// Rotation.
    orientation: Quaternion,
}

/// 36 numbers.
type Covariance = ([f64; 18], [f64; 18]);

#[derive(Debug, Clone, Copy, Deserialize)]
struct Twist {
    /// m/s.
    linear: Vector,
    /// rad/s.
    angular: Vector,
}

#[derive(Debug, Clone, Deserialize)]
struct TwistStamped {
    /// Stamp and frame.
    header: Header,
    /// Velocity.
    twist: Twist,
}

#[derive(Debug, Clone, Deserialize)]
struct Odometry {
    /// Stamp and frame.
    header: Header,
    /// Frame of the twist.
    #[serde(rename = "child_frame_id")]
    _child_frame_id: String,
    /// Where it is.
    pose: (Pose, Covariance),
    /// Velocity.
    twist: (Twist, Covariance),
}

#[derive(Debug, Clone, Deserialize)]
struct JointState {
    /// Stamp and frame.
    header: Header,
    /// Joints.
    name: Vec<String>,
    /// rad, one each, or none.
    position: Vec<f64>,
    /// rad/s, one each, or none.
    velocity: Vec<f64>,
    /// N m or A, one each, or none.
    effort: Vec<f64>,
}

#[derive(Debug, Clone, Deserialize)]
struct Imu {
    /// Stamp and frame.
    header: Header,
    /// Rotation.
    orientation: Quaternion,
    /// Not used.
    _orientation_covariance: [f64; 9],
    /// rad/s.
    angular_velocity: Vector,
    /// Not used.
    _angular_velocity_covariance: [f64; 9],
    /// Not used.
    _linear_acceleration: Vector,
    /// Not used.
    _linear_acceleration_covariance: [f64; 9],
}

/// A message of a kind that is known.
enum Message {
    Odometry(Box<Odometry>),
    JointState(JointState),
    Twist(Twist),
    TwistStamped(TwistStamped),
    Imu(Box<Imu>),
}

/// Kinds that are known, as a file names them.
const KINDS: [&str; 5] = [
    "nav_msgs/msg/Odometry",
    "sensor_msgs/msg/JointState",
    "geometry_msgs/msg/Twist",
    "geometry_msgs/msg/TwistStamped",
    "sensor_msgs/msg/Imu",
];

impl Message {
    /// Reads a message of this kind; `None` for a kind that is not known.
    fn read(kind: &str, data: &[u8]) -> Option<Result<Self, String>> {
        Some(match kind {
            "nav_msgs/msg/Odometry" => decode(data).map(|m| Self::Odometry(Box::new(m))),
            "sensor_msgs/msg/JointState" => decode(data).map(Self::JointState),
            "geometry_msgs/msg/Twist" => decode(data).map(Self::Twist),
            "geometry_msgs/msg/TwistStamped" => decode(data).map(Self::TwistStamped),
            "sensor_msgs/msg/Imu" => decode(data).map(|m| Self::Imu(Box::new(m))),
            _ => return None,
        })
    }

    /// Reads a message of a recording.
    fn decode(message: &BagMessage<'_>) -> Result<Self, String> {
        let kind = message.kind;
        match Self::read(kind, message.data) {
            Some(read) => read.map_err(|e| format!("{kind}: {e}")),
            None => Err(format!(
                "messages of '{kind}'; known are {}",
                KINDS.join(", ")
            )),
        }
    }

    const fn header(&self) -> Option<&Header> {
        Some(match self {
            Self::Odometry(m) => &m.header,
            Self::JointState(m) => &m.header,
            Self::TwistStamped(m) => &m.header,
            Self::Imu(m) => &m.header,
            Self::Twist(_) => return None,
        })
    }

    /// Names of its columns.
    fn columns(&self) -> String {
        const TWIST: &str = "linear.x, linear.y, angular.z, curvature";
        match self {
            Self::Odometry(_) => format!("stamp, log_time, pose.x, pose.y, pose.yaw, {TWIST}"),
            Self::JointState(m) => format!(
                "stamp, log_time, and position, velocity, effort, as far as they are published, \
                 of [{}]",
                m.name.join("], [")
            ),
            Self::Twist(_) | Self::TwistStamped(_) => format!("stamp, log_time, {TWIST}"),
            Self::Imu(_) => "stamp, log_time, angular_velocity.z, yaw".to_owned(),
        }
    }

    /// Value of a column.
    fn value(&self, column: &str) -> Option<f64> {
        if column == "stamp" {
            let Time { sec, nanosec } = self.header()?.stamp;
            return Some(f64::from(sec) * 1e9 + f64::from(nanosec));
        }
        match self {
            Self::Odometry(m) => match column {
                "pose.x" => Some(m.pose.0.position.x),
                "pose.y" => Some(m.pose.0.position.y),
                "pose.yaw" => Some(yaw(m.pose.0.orientation)),
                _ => twist(&m.twist.0, column),
            },
            Self::JointState(m) => m.value(column),
            Self::Twist(m) => twist(m, column),
            Self::TwistStamped(m) => twist(&m.twist, column),
            Self::Imu(m) => match column {
                "angular_velocity.z" => Some(m.angular_velocity.z),
                "yaw" => Some(yaw(m.orientation)),
                _ => None,
            },
        }
    }
}

impl JointState {
    fn value(&self, column: &str) -> Option<f64> {
        let (list, rest) = column.split_once('[')?;
        let joint = rest.strip_suffix(']')?;
        let at = self.name.iter().position(|name| name == joint)?;
        let values = match list {
            "position" => &self.position,
            "velocity" => &self.velocity,
            "effort" => &self.effort,
            _ => return None,
        };
        values.get(at).copied()
    }
}

fn twist(twist: &Twist, column: &str) -> Option<f64> {
    Some(match column {
        "linear.x" => twist.linear.x,
        "linear.y" => twist.linear.y,
        "angular.z" => twist.angular.z,
        "curvature" if twist.linear.x.abs() < REST_M_S => 0.0,
        "curvature" => twist.angular.z / twist.linear.x,
        _ => return None,
    })
}

/// Rotation about the vertical axis, rad.
fn yaw(q: Quaternion) -> f64 {
    let (sine, cosine) = (q.w * q.z + q.x * q.y, 0.5 - q.y * q.y - q.z * q.z);
    sine.atan2(cosine)
}

/// Reads CDR with its four bytes of encapsulation, of either byte order.
fn decode<T: DeserializeOwned>(data: &[u8]) -> Result<T, String> {
    let (head, body) = data.split_at_checked(4).ok_or("too short")?;
    let message = match head {
        [0, 0, ..] => cdr_encoding::from_bytes::<T, BigEndian>(body),
        [0, 1, ..] => cdr_encoding::from_bytes::<T, LittleEndian>(body),
        _ => return Err("not in plain CDR".into()),
    };
    message.map(|(m, _)| m).map_err(|e| e.to_string())
}

/// Messages of a topic that lack a column: nothing is made of them. Two programs may share a topic,
/// each with joints of its own; a first message may hold nothing yet.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct MissingColumn {
    /// The file.
    pub path: PathBuf,
    /// Its topic.
    pub topic: String,
    /// The first column that is not there, or not finite, in the first such message.
    pub column: String,
    /// Such messages.
    pub messages: usize,
    /// All messages of the topic.
    pub of: usize,
}

/// What the messages of a topic hold.
pub(super) struct TopicColumns {
    /// Column by column.
    pub values: Vec<Vec<f64>>,
    /// Messages that lack a column.
    pub lacking: Option<MissingColumn>,
    /// True if `stamp` was asked of messages without a header: the recorder's time took its place.
    pub is_unstamped: bool,
    /// Where the file is cut off, if it is.
    pub cut: Option<CutBag>,
}

/// The values of `columns` in every message of `topic` that has them all.
///
/// # Errors
/// With the file, the message (from 1) and what is known, if the file or a message cannot be read,
/// or a column does not exist.
pub(super) fn columns(
    path: &Path,
    topic: &str,
    columns: &[String],
) -> Result<TopicColumns, ImportError> {
    let wrong = |row: u64, message: String| ImportError::from(wrong_row(path, row, message));
    let mut values = vec![Vec::new(); columns.len()];
    let (mut row, mut others, mut lacking) = (0, Vec::<String>::new(), None::<MissingColumn>);
    let (mut known, mut is_unstamped) = (String::new(), false);
    let cut = bag::visit(path, &mut |message: &BagMessage<'_>| {
        if message.topic != topic {
            if !others.iter().any(|other| other == message.topic) {
                others.push(message.topic.to_owned());
            }
            return Ok(());
        }
        row += 1;
        let decoded = Message::decode(message).map_err(|e| wrong(row, format!("{topic}: {e}")))?;
        let has_stamp = decoded.header().is_some();
        is_unstamped |= !has_stamp && columns.iter().any(|column| column == "stamp");
        let value = |column: &String| match column.as_str() {
            "log_time" => Some(message.log_time_ns as f64),
            "stamp" if !has_stamp => Some(message.log_time_ns as f64),
            name => decoded.value(name).filter(|value| value.is_finite()),
        };
        match columns.iter().find(|column| value(column).is_none()) {
            Some(column) => {
                let lacking = lacking.get_or_insert_with(|| {
                    known = decoded.columns();
                    MissingColumn {
                        path: path.to_owned(),
                        topic: topic.to_owned(),
                        column: column.clone(),
                        messages: 0,
                        of: 0,
                    }
                });
                lacking.messages += 1;
            }
            None => {
                let found = columns.iter().filter_map(value);
                values
                    .iter_mut()
                    .zip(found)
                    .for_each(|(all, value)| all.push(value));
            }
        }
        Ok(())
    })?;
    if values.iter().all(Vec::is_empty) {
        let why = lacking.map_or_else(
            || format!("no message on {topic}; there are {}", others.join(", ")),
            |lacking| {
                let column = &lacking.column;
                format!("there is no finite '{column}' on {topic}; its messages have {known}")
            },
        );
        return Err(wrong(row, why));
    }
    if let Some(lacking) = &mut lacking {
        lacking.of = row as usize;
    }
    Ok(TopicColumns {
        values,
        lacking,
        is_unstamped,
        cut,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// CDR by hand: a twist (1, 2, 3), (4, 5, 6).
    fn twist_bytes(big: bool) -> Vec<u8> {
        let mut bytes = vec![0, u8::from(!big), 0, 0];
        for value in 1..=6 {
            let value = f64::from(value);
            bytes.extend(if big {
                value.to_be_bytes()
            } else {
                value.to_le_bytes()
            });
        }
        bytes
    }

    #[test]
    fn both_byte_orders_are_read_and_nothing_else() {
        for big in [false, true] {
            let read = Message::read("geometry_msgs/msg/Twist", &twist_bytes(big));
            let message = read.unwrap().unwrap();
            let of = |column| message.value(column);
            assert_eq!([of("linear.x"), of("linear.y")], [Some(1.0), Some(2.0)]);
            assert_eq!([of("angular.z"), of("curvature")], [Some(6.0), Some(6.0)]);
            assert_eq!([of("stamp"), of("linear.w")], [None, None]);
        }
        let mut other = twist_bytes(false);
        other[1] = 7;
        assert!(decode::<Twist>(&other).is_err());
        assert!(decode::<Twist>(&other[..3]).is_err());
        let short = &twist_bytes(false)[..40];
        assert!(decode::<Twist>(short).is_err());
        assert!(Message::read("std_msgs/msg/String", short).is_none());
    }

    #[test]
    fn yaw_is_the_rotation_about_the_vertical_axis() {
        for angle in [-3.0_f64, -1.0, 0.0, 0.5, 3.1] {
            let q = Quaternion {
                x: 0.0,
                y: 0.0,
                z: (angle / 2.0).sin(),
                w: (angle / 2.0).cos(),
            };
            assert!((yaw(q) - angle).abs() < 1e-12);
        }
    }
}
