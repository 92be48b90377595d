//! What messages of ROS 2 consist of, as their schemas say it. Names, types and order of the fields
//! are those of the released packages, so that readers take their own types for them.

/// A message's type with the types that it is made of.
#[derive(Debug, PartialEq, Eq)]
pub(crate) struct Definition {
    /// Name with its package: `sensor_msgs/msg/JointState`.
    pub(crate) name: &'static str,
    /// Its fields, a line each.
    fields: &'static str,
    /// Every other type that occurs in it, at any depth.
    parts: &'static [Part],
}

#[derive(Debug, PartialEq, Eq)]
struct Part {
    name: &'static str,
    fields: &'static str,
}

impl Definition {
    /// The schema's text: the message, then each part after a line of equals signs.
    pub(crate) fn text(&self) -> String {
        let line = "=".repeat(80);
        let part = |part: &Part| format!("{line}\nMSG: {}\n{}", part.name, part.fields);
        let parts: String = self.parts.iter().map(part).collect();
        format!("{}{parts}", self.fields)
    }
}

const fn part(name: &'static str, fields: &'static str) -> Part {
    Part { name, fields }
}

const TIME: Part = part("builtin_interfaces/Time", "int32 sec\nuint32 nanosec\n");
const HEADER: Part = part(
    "std_msgs/Header",
    "builtin_interfaces/Time stamp\nstring frame_id\n",
);
const VECTOR: Part = part("geometry_msgs/Vector3", "float64 x\nfloat64 y\nfloat64 z\n");
const POINT: Part = part("geometry_msgs/Point", "float64 x\nfloat64 y\nfloat64 z\n");
const QUATERNION: Part = part(
    "geometry_msgs/Quaternion",
    "float64 x\nfloat64 y\nfloat64 z\nfloat64 w\n",
);
const POSE: Part = part(
    "geometry_msgs/Pose",
    "geometry_msgs/Point position\ngeometry_msgs/Quaternion orientation\n",
);
const POSE_WITH_COVARIANCE: Part = part(
    "geometry_msgs/PoseWithCovariance",
    "geometry_msgs/Pose pose\nfloat64[36] covariance\n",
);
const TWIST: Part = part(
    "geometry_msgs/Twist",
    "geometry_msgs/Vector3 linear\ngeometry_msgs/Vector3 angular\n",
);
const TWIST_WITH_COVARIANCE: Part = part(
    "geometry_msgs/TwistWithCovariance",
    "geometry_msgs/Twist twist\nfloat64[36] covariance\n",
);
const TRANSFORM: Part = part(
    "geometry_msgs/Transform",
    "geometry_msgs/Vector3 translation\ngeometry_msgs/Quaternion rotation\n",
);
const TRANSFORM_STAMPED: Part = part(
    "geometry_msgs/TransformStamped",
    "std_msgs/Header header\nstring child_frame_id\ngeometry_msgs/Transform transform\n",
);
const KEY_VALUE: Part = part("diagnostic_msgs/KeyValue", "string key\nstring value\n");
const DIAGNOSTIC_STATUS: Part = part(
    "diagnostic_msgs/DiagnosticStatus",
    "byte OK=0\nbyte WARN=1\nbyte ERROR=2\nbyte STALE=3\n\
     byte level\nstring name\nstring message\nstring hardware_id\n\
     diagnostic_msgs/KeyValue[] values\n",
);

/// Named numbers.
pub(crate) const JOINT_STATE: Definition = Definition {
    name: "sensor_msgs/msg/JointState",
    fields: "std_msgs/Header header\nstring[] name\nfloat64[] position\nfloat64[] velocity\n\
             float64[] effort\n",
    parts: &[HEADER, TIME],
};

/// A pose and a velocity.
pub(crate) const ODOMETRY: Definition = Definition {
    name: "nav_msgs/msg/Odometry",
    fields: "std_msgs/Header header\nstring child_frame_id\n\
             geometry_msgs/PoseWithCovariance pose\ngeometry_msgs/TwistWithCovariance twist\n",
    parts: &[
        HEADER,
        TIME,
        POSE_WITH_COVARIANCE,
        POSE,
        POINT,
        QUATERNION,
        TWIST_WITH_COVARIANCE,
        TWIST,
        VECTOR,
    ],
};

/// Where frames lie in each other.
pub(crate) const TF_MESSAGE: Definition = Definition {
    name: "tf2_msgs/msg/TFMessage",
    fields: "geometry_msgs/TransformStamped[] transforms\n",
    parts: &[
        TRANSFORM_STAMPED,
        HEADER,
        TIME,
        TRANSFORM,
        VECTOR,
        QUATERNION,
    ],
};

/// How several things are.
pub(crate) const DIAGNOSTIC_ARRAY: Definition = Definition {
    name: "diagnostic_msgs/msg/DiagnosticArray",
    fields: "std_msgs/Header header\ndiagnostic_msgs/DiagnosticStatus[] status\n",
    parts: &[HEADER, TIME, DIAGNOSTIC_STATUS, KEY_VALUE],
};

/// A text.
pub(crate) const STRING: Definition = Definition {
    name: "std_msgs/msg/String",
    fields: "string data\n",
    parts: &[],
};

/// A line of a log.
pub(crate) const LOG: Definition = Definition {
    name: "rcl_interfaces/msg/Log",
    fields: "uint8 DEBUG=10\nuint8 INFO=20\nuint8 WARN=30\nuint8 ERROR=40\nuint8 FATAL=50\n\
             builtin_interfaces/Time stamp\nuint8 level\nstring name\nstring msg\n\
             string file\nstring function\nuint32 line\n",
    parts: &[TIME],
};

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parts_follow_the_message_each_after_its_line() {
        let expected = "builtin_interfaces/Time stamp\nstring frame_id\n".to_owned();
        let text = Definition {
            name: "a/msg/B",
            fields: "std_msgs/Header header\n",
            parts: &[HEADER, TIME],
        }
        .text();
        let line = "=".repeat(80);
        assert_eq!(
            text,
            format!(
                "std_msgs/Header header\n{line}\nMSG: std_msgs/Header\n{expected}{line}\n\
                 MSG: builtin_interfaces/Time\nint32 sec\nuint32 nanosec\n"
            )
        );
    }

    #[test]
    fn every_type_that_a_message_is_made_of_is_defined_once() {
        for definition in [
            &JOINT_STATE,
            &ODOMETRY,
            &TF_MESSAGE,
            &DIAGNOSTIC_ARRAY,
            &STRING,
            &LOG,
        ] {
            let text = definition.text();
            let types = text.lines().filter_map(|line| line.split(' ').next());
            for name in types.filter(|name| name.contains('/')) {
                let name = name.trim_end_matches("[]");
                let count = text.matches(&format!("MSG: {name}\n")).count();
                assert_eq!(count, 1, "{}: {name}", definition.name);
            }
        }
    }
}
