//! What a column may be, by its name and that of its topic or file.

/// What a column may be.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Guess {
    /// Commanded velocity forward, left, or yaw rate: 0, 1, 2.
    Command(usize),
    /// Rate of a wheel.
    WheelRate,
    /// Position or count of a wheel.
    WheelPosition,
    /// Current of a wheel's motor.
    WheelCurrent,
    /// Yaw rate of a gyro.
    Gyro,
    /// Position x, y, or yaw: 0, 1, 2.
    Pose(usize),
    /// Forward velocity as a driver reckons it.
    Speed,
    /// A channel beside these: its role and unit.
    Further(&'static str, &'static str),
}

/// Side of a wheel.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Side {
    /// Left.
    Left,
    /// Right.
    Right,
}

/// Words of a name, in small letters: `velL`, `m1vel`, `field.left_encoder` give `vel l`,
/// `m 1 vel`, `field left encoder`.
pub(super) fn words(name: &str) -> Vec<String> {
    let (mut out, mut word) = (Vec::new(), String::new());
    let class = |c: char| match c {
        _ if c.is_ascii_digit() => 0,
        _ if c.is_uppercase() => 1,
        _ => 2,
    };
    let mut last: Option<char> = None;
    for c in name.chars() {
        let starts = last.is_some_and(|last| {
            let (before, now) = (class(last), class(c));
            before != now && !(before == 1 && now == 2)
        });
        if (starts || !c.is_alphanumeric()) && !word.is_empty() {
            out.push(std::mem::take(&mut word));
        }
        if c.is_alphanumeric() {
            word.extend(c.to_lowercase());
        }
        last = Some(c).filter(|c| c.is_alphanumeric());
    }
    if !word.is_empty() {
        out.push(word);
    }
    out
}

fn any(words: &[String], of: &[&str]) -> bool {
    words.iter().any(|word| of.contains(&word.as_str()))
}

/// Side that a name tells.
pub(super) fn side(name: &str) -> Option<Side> {
    let words = words(name);
    let left = any(
        &words,
        &["left", "l", "fl", "bl", "rl", "lf", "lb", "lm", "lr", "ml"],
    );
    let right = any(
        &words,
        &["right", "r", "fr", "br", "rr", "rf", "rb", "rm", "mr"],
    );
    match (left, right) {
        (true, false) => Some(Side::Left),
        (false, true) => Some(Side::Right),
        _ => None,
    }
}

/// Number that a name tells.
pub(super) fn number(name: &str) -> Option<u32> {
    words(name).iter().find_map(|word| word.parse().ok())
}

/// True if a name says that something is wanted rather than measured.
fn is_wanted(name: &str) -> bool {
    let words = words(name);
    let lower = name.to_lowercase();
    let whole = [
        "cmd", "command", "commands", "set", "setpoint", "ref", "target", "desired",
    ];
    any(&words, &whole)
        || ["setspeed", "setvel", "cmdvel"]
            .iter()
            .any(|part| lower.contains(part))
}

/// What a column of a topic or file may be; none if nothing is known of such a name.
pub(super) fn guess(table: &str, kind: &str, column: &str) -> Option<Guess> {
    let lower = column.to_lowercase();
    let lower = lower.trim_start_matches("field.");
    let table = table.rsplit('/').take(2).collect::<Vec<_>>().join("/");
    let own = words(column);
    if any(&own, &["covariance", "seq", "header", "over"]) || lower.ends_with("stamp") {
        return None;
    }
    let has_place = side(column).is_some() || number(column).is_some();
    if is_wanted(&table) || is_wanted(column) {
        return wanted(lower, &own, has_place);
    }
    if let Some(joint) = joint(kind, lower) {
        return joint;
    }
    if any(&own, &["current", "cur", "amps", "amp", "currents"]) {
        let is_axis = any(&own, &["x", "y", "rot"]) || lower.starts_with(['x', 'y']);
        return match (has_place, is_axis) {
            (true, _) => Some(Guess::WheelCurrent),
            (false, false) if own.len() < 4 => Some(Guess::Further("current", "A")),
            _ => None,
        };
    }
    wheel(&own, has_place).or_else(|| body(&table, lower, &own))
}

/// A command, by the axis that its name tells.
fn wanted(lower: &str, own: &[String], has_place: bool) -> Option<Guess> {
    let says = [
        "cmd", "command", "set", "setpoint", "ref", "target", "desired",
    ];
    let bare = lower
        .split('_')
        .filter(|part| !says.contains(part))
        .collect::<Vec<_>>()
        .join("_");
    let ends = |endings: &[&str]| endings.iter().any(|ending| bare.ends_with(ending));
    if any(own, &["delta", "error", "err"]) {
        return None;
    }
    let is_turn = ends(&[
        "angular.z",
        "yaw_rate",
        "yawrate",
        "omega",
        "wz",
        "turn",
        "rotation",
        "ang",
        "angular",
        "angular_z",
        "ang_z",
        "yaw",
        "rot",
    ]);
    if is_turn || bare == "w" {
        return Some(Guess::Command(2));
    }
    if ends(&["linear.y", "vy", "left"]) || bare.starts_with('y') {
        return Some(Guess::Command(1));
    }
    let is_forward = ends(&[
        "linear.x", "linear_x", "lin_x", "vx", "speed", "forward", "velocity", "vel", "lin",
        "linear",
    ]) || ["v", "x"].contains(&bare.as_str());
    (is_forward && !has_place).then_some(Guess::Command(0))
}

/// A column of joint states, of a topic or of its CSV form, in which names are lost.
fn joint(kind: &str, lower: &str) -> Option<Option<Guess>> {
    if !kind.ends_with("JointState") {
        return None;
    }
    let is_steering = words(lower).iter().any(|word| word.starts_with("steer"));
    Some(match lower.split('[').next() {
        _ if is_steering => None,
        Some("velocity") => Some(Guess::WheelRate),
        Some("position") => Some(Guess::WheelPosition),
        _ => None,
    })
}

/// A wheel's rate or position.
fn wheel(own: &[String], has_place: bool) -> Option<Guess> {
    if !has_place
        || any(
            own,
            &["drop", "slip", "pwm", "radius", "temperature", "temp"],
        )
    {
        return None;
    }
    let is_rate = any(own, &["vel", "velocity", "speed", "rpm", "rate"]);
    let is_count = any(
        own,
        &[
            "encoder", "enc", "ticks", "tick", "count", "counts", "encoders",
        ],
    );
    let is_position = any(own, &["pos", "position"]) && any(own, &["m", "motor", "wheel", "joint"]);
    match (is_rate, is_count || is_position) {
        (true, _) => Some(Guess::WheelRate),
        (false, true) => Some(Guess::WheelPosition),
        _ => None,
    }
}

/// Words that say whose place a number is, or in which unit.
const PLACE_WORDS: [&str; 14] = [
    "odom", "odometry", "pose", "pos", "position", "robot", "base", "link", "map", "world", "m",
    "mm", "rad", "deg",
];
/// Words that say whose rate a number is.
const GYRO_WORDS: [&str; 13] = [
    "imu", "gyro", "gyr", "angular", "vel", "velocity", "rate", "body", "base", "raw", "rad",
    "deg", "s",
];

/// What moves with the body.
fn body(table: &str, lower: &str, own: &[String]) -> Option<Guess> {
    if any(own, &["delta", "error", "err"]) {
        return Some(Guess::Further("tracking-error", ""));
    }
    if let Some(rate) = body_rate(lower, own) {
        return Some(rate);
    }
    let lower_table = table.to_lowercase();
    if lower_table.contains("odom") && is(lower, &["twist.twist.linear.x"]) {
        return Some(Guess::Speed);
    }
    if lower.contains("twist") {
        return None;
    }
    let accelerations = [
        "linear_acceleration.x",
        "linear_acceleration.y",
        "linear_acceleration.z",
    ];
    let words = ["acc", "accel", "acceleration", "ax", "ay", "az"];
    if is(lower, &accelerations) || any(own, &words) {
        return Some(Guess::Further("acceleration", "m/s2"));
    }
    if let Some(axis) = pose(&lower_table, lower, own) {
        return Some(Guess::Pose(axis));
    }
    if is(lower, &["roll", "pitch", "yaw", "qx", "qy", "qz"]) {
        return Some(Guess::Further("attitude", ""));
    }
    if any(own, &["voltage", "volt", "volts", "battery"]) {
        return Some(Guess::Further("voltage", "V"));
    }
    let is_velocity = lower.starts_with("vel_");
    is_velocity.then_some(Guess::Further("other", "m/s"))
}

/// True if a name is one of these, or ends in one as a field.
fn is(lower: &str, names: &[&str]) -> bool {
    let ends = |name: &&str| lower == *name || lower.ends_with(&format!(".{name}"));
    names.iter().any(ends)
}

/// What is left of a name without the words that say of what: `odom_x`, `base_gyro_z`.
fn bare<'a>(own: &'a [String], words: &[&str]) -> Vec<&'a str> {
    let own = own.iter().map(String::as_str);
    own.filter(|word| !words.contains(word)).collect()
}

/// A rate of the body, by a gyro.
fn body_rate(lower: &str, own: &[String]) -> Option<Guess> {
    let has_both = any(own, &["angular"]) && any(own, &["vel", "velocity"]);
    let is_gyro = any(own, &["gyro", "gyr"]) || has_both;
    let axis = bare(own, &GYRO_WORDS);
    let turns = [
        "angular_velocity.z",
        "gyro_z",
        "gz",
        "wz",
        "yaw_rate",
        "yawrate",
        "gyro.z",
    ];
    if is(lower, &turns) || is_gyro && matches!(axis[..], ["z" | "yaw"]) {
        return Some(Guess::Gyro);
    }
    let tilts = [
        "angular_velocity.x",
        "angular_velocity.y",
        "gyro_x",
        "gyro_y",
        "wx",
        "wy",
    ];
    let is_tilt = is_gyro && matches!(axis[..], ["x" | "y" | "roll" | "pitch"]);
    let is_rate = is(lower, &tilts) || lower.starts_with("rate_") || is_tilt;
    is_rate.then_some(Guess::Further("body-rate", "rad/s"))
}

/// An axis of the pose.
fn pose(lower_table: &str, lower: &str, own: &[String]) -> Option<usize> {
    // Short names are also parts of quaternions and vectors.
    let plain = |names: [&str; 3]| names.contains(&lower);
    let place = bare(own, &PLACE_WORDS);
    if is(lower, &["position.x", "translation.x"])
        || plain(["x", "xpos", "pos_x"])
        || place == ["x"]
    {
        return Some(0);
    }
    if is(lower, &["position.y", "translation.y"])
        || plain(["y", "ypos", "pos_y"])
        || place == ["y"]
    {
        return Some(1);
    }
    let angles = [
        "pose.orientation.yaw",
        "rotation.yaw",
        "yaw",
        "ang",
        "theta",
        "heading",
    ];
    let is_angle = is(lower, &angles) && !lower_table.contains("imu");
    let is_odometry = any(own, &["odom", "odometry", "pose"]);
    let is_of_odometry = is_odometry && matches!(place[..], ["yaw" | "theta" | "th" | "heading"]);
    (is_angle || is_of_odometry).then_some(2)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn usual_names_are_known() {
        let joints = "sensor_msgs/msg/JointState";
        for (table, kind, column, wanted) in [
            ("/cmd_vel", "", "linear.x", Some(Guess::Command(0))),
            ("/cmd_vel", "", "angular.z", Some(Guess::Command(2))),
            ("exp.csv", "", "ysetspeed", Some(Guess::Command(1))),
            ("exp.csv", "", "m1setvel", None),
            ("exp.csv", "", "omega_cmd", Some(Guess::Command(2))),
            ("exp.csv", "", "cmd_v", Some(Guess::Command(0))),
            ("log.csv", "", "cmd_lin", Some(Guess::Command(0))),
            ("log.csv", "", "cmd_ang", Some(Guess::Command(2))),
            ("log.csv", "", "cmd_vel_angular_z", Some(Guess::Command(2))),
            ("log.csv", "", "cmd_yaw", Some(Guess::Command(2))),
            ("log.csv", "", "odom_x", Some(Guess::Pose(0))),
            ("log.csv", "", "robot_pos_y_m", Some(Guess::Pose(1))),
            ("log.csv", "", "odom_yaw", Some(Guess::Pose(2))),
            ("log.csv", "", "imu_gyro_z", Some(Guess::Gyro)),
            ("log.csv", "", "imu_angular_velocity_z", Some(Guess::Gyro)),
            ("log.csv", "", "pose.orientation.x", None),
            (
                "/joint_states",
                joints,
                "velocity[wheel_left_joint]",
                Some(Guess::WheelRate),
            ),
            ("/joint_states", joints, "position[steer_left]", None),
            (
                "core.csv",
                "",
                "field.left_encoder",
                Some(Guess::WheelPosition),
            ),
            ("core.csv", "", "field.current0", Some(Guess::WheelCurrent)),
            ("pro.csv", "", "velL", Some(Guess::WheelRate)),
            ("pro.csv", "", "curR", Some(Guess::WheelCurrent)),
            ("exp.csv", "", "m2vel", Some(Guess::WheelRate)),
            ("/imu", "", "angular_velocity.z", Some(Guess::Gyro)),
            ("imu.csv", "", "wz", Some(Guess::Gyro)),
            (
                "/odom",
                "",
                "pose.pose.orientation.yaw",
                Some(Guess::Pose(2)),
            ),
            (
                "/imu",
                "",
                "orientation.yaw",
                Some(Guess::Further("attitude", "")),
            ),
            (
                "/battery_state",
                "",
                "voltage",
                Some(Guess::Further("voltage", "V")),
            ),
            (
                "f.csv",
                "",
                "delta_yaw",
                Some(Guess::Further("tracking-error", "")),
            ),
            ("/imu", "", "orientation.x", None),
            ("core.csv", "", "field.header.seq", None),
        ] {
            assert_eq!(guess(table, kind, column), wanted, "{table} {column}");
        }
    }

    #[test]
    fn names_are_cut_into_words_and_tell_sides() {
        assert_eq!(words("velL"), ["vel", "l"]);
        assert_eq!(words("m1vel"), ["m", "1", "vel"]);
        assert_eq!(words("field.leftEncoder"), ["field", "left", "encoder"]);
        assert_eq!(side("wheel_left_joint"), Some(Side::Left));
        assert_eq!(side("velR"), Some(Side::Right));
        assert_eq!(side("position[fl_wheel]"), Some(Side::Left));
        assert_eq!((side("m1vel"), number("m1vel")), (None, Some(1)));
    }
}
