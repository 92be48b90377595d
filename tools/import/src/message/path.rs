//! Where a column lies in a message: a path of fields, as `twist.twist.linear.x`, `data[2]`,
//! `velocity[left_wheel]`, `transforms[base_link].transform.translation.x`.

use super::schema::{Count, Field, Kind, Schema};

/// Fields that a path may leave out. Twists lie two deep in an odometry, its numbers three.
const OMITTED_MAX: usize = 4;

/// A step of a path as written.
#[derive(Debug, Clone, PartialEq, Eq)]
enum Step {
    Name(String),
    Index(usize),
    Key(String),
}

/// A step of a path as found in a type.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) enum Hop {
    /// A field, by its place.
    Field(usize),
    /// An element of a list.
    Index(usize),
    /// The element of a list of numbers whose place this name has in the list of strings beside
    /// it; of a list of messages the first with a string of this value.
    Key(String),
}

/// What is made of the numbers found.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Combine {
    /// The number itself.
    One,
    /// ns, from seconds and nanoseconds.
    Time,
    /// Rotations of a quaternion x, y, z, w, rad: about the x axis,
    Roll,
    /// about y,
    Pitch,
    /// and about z, in this order backwards from a fixed frame (REP 103).
    Yaw,
    /// Yaw rate over forward speed, 1/m, from both; 0 at rest.
    Curvature,
}

/// Forward speed below which a twist has no curvature, m/s.
const REST_M_S: f64 = 1e-3;

impl Combine {
    /// The value, from the numbers of its leaves.
    pub fn value(self, of: &[f64]) -> Option<f64> {
        Some(match (self, of) {
            (Self::One, &[value]) => value,
            (Self::Time, &[sec, nanosec]) => sec * 1e9 + nanosec,
            (Self::Roll, &[x, y, z, w]) => (w * x + y * z).atan2(0.5 - x * x - y * y),
            (Self::Pitch, &[x, y, z, w]) => (2.0 * (w * y - z * x)).clamp(-1.0, 1.0).asin(),
            (Self::Yaw, &[x, y, z, w]) => (w * z + x * y).atan2(0.5 - y * y - z * z),
            (Self::Curvature, &[forward, _]) if forward.abs() < REST_M_S => 0.0,
            (Self::Curvature, &[forward, yaw_rate]) => yaw_rate / forward,
            _ => return None,
        })
    }
}

/// A column of a type: its leaves, and what is made of them.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Column {
    /// Paths to numbers.
    pub leaves: Vec<Vec<Hop>>,
    /// What is made of them.
    pub combine: Combine,
}

/// Finds a column in a type. Fields may be left out where only one way fits: `linear.x` is
/// `twist.twist.linear.x` in an odometry.
///
/// # Errors
/// A path that leads nowhere, or more than one way.
pub(super) fn resolve(schema: &Schema, path: &str) -> Result<Column, String> {
    let steps = steps(path).ok_or_else(|| format!("'{path}' is no path, such as a.b[2].c"))?;
    for omitted in 0..=OMITTED_MAX {
        let mut found = Vec::new();
        search(schema, schema.root(), &steps, omitted, &mut found);
        let Some(first) = found.first().cloned() else {
            continue;
        };
        let mut ways: Vec<String> = found.iter().map(|c| written(schema, c)).collect();
        ways.dedup();
        if ways.len() == 1 {
            return Ok(first);
        }
        return Err(format!("'{path}' may be {}: write one", ways.join(" or ")));
    }
    Err(format!("there is no '{path}'"))
}

/// The steps of a path; a key may hold dots.
fn steps(path: &str) -> Option<Vec<Step>> {
    let (mut out, mut rest) = (Vec::new(), path);
    while !rest.is_empty() {
        if let Some(inside) = rest.strip_prefix('[') {
            let (key, after) = inside.split_once(']')?;
            out.push(match key.parse() {
                Ok(index) => Step::Index(index),
                Err(_) => Step::Key(key.to_owned()),
            });
            rest = after.strip_prefix('.').unwrap_or(after);
            continue;
        }
        let end = rest.find(['.', '[']).unwrap_or(rest.len());
        let (name, after) = rest.split_at(end);
        if name.is_empty() {
            return None;
        }
        out.push(Step::Name(name.to_owned()));
        rest = after.strip_prefix('.').unwrap_or(after);
    }
    (!out.is_empty()).then_some(out)
}

/// Every way in which `steps` fit the type `at` when exactly `omitted` fields are left out.
fn search(schema: &Schema, at: usize, steps: &[Step], omitted: usize, found: &mut Vec<Column>) {
    let Some((Step::Name(name), rest)) = steps.split_first() else {
        return;
    };
    let fields = schema.get(at);
    let own = fields.iter().position(|field| field.name == *name);
    if let Some((place, field)) = own.and_then(|place| Some((place, fields.get(place)?))) {
        let indices = rest.iter().take_while(|s| !matches!(s, Step::Name(_)));
        let indices = indices.count();
        let (indices, rest) = rest.split_at(indices);
        let mut inner = Vec::new();
        match (field.kind, rest.is_empty()) {
            _ if (field.count != Count::One) != (indices.len() == 1) => {}
            (Kind::Struct(child), true) if omitted == 0 => {
                inner.extend(as_number(schema, child));
            }
            (Kind::Struct(child), false) => search(schema, child, rest, omitted, &mut inner),
            (Kind::Struct(_), true) => {}
            (_, true) if omitted == 0 => inner.push(Column {
                leaves: vec![Vec::new()],
                combine: Combine::One,
            }),
            _ => {}
        }
        let mut before = vec![Hop::Field(place)];
        before.extend(indices.iter().filter_map(|index| match index {
            Step::Index(index) => Some(Hop::Index(*index)),
            Step::Key(key) => Some(Hop::Key(key.clone())),
            Step::Name(_) => None,
        }));
        found.extend(inner.into_iter().map(|column| column.within(&before)));
    }
    if omitted == 0 {
        if rest.is_empty() && own.is_none() {
            found.extend(derived(schema, at, name));
        }
        return;
    }
    for (place, field) in fields.iter().enumerate() {
        if let (Kind::Struct(child), Count::One) = (field.kind, field.count) {
            let mut inner = Vec::new();
            search(schema, child, steps, omitted - 1, &mut inner);
            found.extend(inner.into_iter().map(|c| c.within(&[Hop::Field(place)])));
        }
    }
}

impl Column {
    fn within(mut self, before: &[Hop]) -> Self {
        for leaf in &mut self.leaves {
            leaf.splice(0..0, before.iter().cloned());
        }
        self
    }
}

/// A time as one number.
fn as_number(schema: &Schema, at: usize) -> Option<Column> {
    let is_time = matches!(
        schema.name(at),
        "builtin_interfaces/Time" | "builtin_interfaces/Duration"
    );
    is_time.then(|| leaves(schema, at, &["sec", "nanosec"], Combine::Time))?
}

/// What a type means beside its fields: angles of a quaternion, curvature of a twist, coordinates
/// of a pose.
pub(super) fn derived(schema: &Schema, at: usize, name: &str) -> Option<Column> {
    let angle = |combine| leaves(schema, at, &["x", "y", "z", "w"], combine);
    match name {
        "yaw" => angle(Combine::Yaw),
        "pitch" => angle(Combine::Pitch),
        "roll" => angle(Combine::Roll),
        "curvature" => leaves(schema, at, &["linear.x", "angular.z"], Combine::Curvature),
        "x" | "y" | "z" => ["position", "translation"].iter().find_map(|part| {
            let path = format!("{part}.{name}");
            leaves(schema, at, &[&path], Combine::One)
        }),
        _ => None,
    }
}

/// Numbers of a type by their full names.
fn leaves(schema: &Schema, at: usize, names: &[&str], combine: Combine) -> Option<Column> {
    let leaf = |name: &&str| {
        let (mut at, mut hops) = (Some(at), Vec::new());
        for part in name.split('.') {
            let fields = schema.get(at?);
            let place = fields.iter().position(|field| field.name == part)?;
            let field = fields.get(place)?;
            hops.push(Hop::Field(place));
            at = match (field.kind, field.count) {
                (Kind::Struct(child), Count::One) => Some(child),
                (kind, Count::One) if kind.size().is_some() => None,
                _ => return None,
            };
        }
        at.is_none().then_some(hops)
    };
    let leaves = names.iter().map(leaf).collect::<Option<Vec<_>>>()?;
    Some(Column { leaves, combine })
}

/// A column's full path, for messages.
fn written(schema: &Schema, column: &Column) -> String {
    let (mut at, mut out) = (schema.root(), String::new());
    for hop in column.leaves.first().map_or(&[][..], Vec::as_slice) {
        match hop {
            Hop::Field(place) => {
                let Some(Field { name, kind, .. }) = schema.get(at).get(*place) else {
                    break;
                };
                if !out.is_empty() {
                    out.push('.');
                }
                out.push_str(name);
                if let Kind::Struct(child) = kind {
                    at = *child;
                }
            }
            Hop::Index(index) => out += &format!("[{index}]"),
            Hop::Key(key) => out += &format!("[{key}]"),
        }
    }
    let end = match column.combine {
        Combine::Yaw => "yaw",
        Combine::Pitch => "pitch",
        Combine::Roll => "roll",
        Combine::Curvature => "curvature",
        Combine::One | Combine::Time => return out,
    };
    let parent = out.rsplit_once('.').map_or("", |(parent, _)| parent);
    format!("{parent}.{end}")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn full(kind: &str, path: &str) -> String {
        let schema = Schema::parse(kind, "").unwrap();
        match resolve(&schema, path) {
            Ok(column) => written(&schema, &column),
            Err(error) => error,
        }
    }

    #[test]
    fn fields_may_be_left_out_where_one_way_fits() {
        for (kind, path, wanted) in [
            ("nav_msgs/Odometry", "stamp", "header.stamp.sec"),
            ("nav_msgs/Odometry", "pose.x", "pose.pose.position.x"),
            ("nav_msgs/Odometry", "pose.yaw", "pose.pose.orientation.yaw"),
            ("nav_msgs/Odometry", "linear.x", "twist.twist.linear.x"),
            (
                "nav_msgs/Odometry",
                "pose.covariance[7]",
                "pose.covariance[7]",
            ),
            ("geometry_msgs/TwistStamped", "angular.z", "twist.angular.z"),
            ("sensor_msgs/Imu", "yaw", "orientation.yaw"),
            ("sensor_msgs/JointState", "velocity[a.b]", "velocity[a.b]"),
            (
                "tf2_msgs/TFMessage",
                "transforms[base].transform.x",
                "transforms[base].transform.translation.x",
            ),
            ("nav_msgs/Odometry", "linear", "there is no 'linear'"),
            (
                "nav_msgs/Odometry",
                "a..b",
                "'a..b' is no path, such as a.b[2].c",
            ),
            (
                "sensor_msgs/JointState",
                "velocity",
                "there is no 'velocity'",
            ),
            ("std_msgs/Float64", "data[0]", "there is no 'data[0]'"),
            (
                "geometry_msgs/Wrench",
                "x",
                "'x' may be force.x or torque.x: write one",
            ),
        ] {
            assert_eq!(full(kind, path), wanted, "{kind} {path}");
        }
    }

    #[test]
    fn angles_are_those_of_the_quaternion() {
        // Roll alone, pitch alone, yaw alone: half angles by the definition of a quaternion.
        for angle in [-1.5_f64, -0.3, 0.0, 0.7, 1.4] {
            let (s, c) = (angle / 2.0).sin_cos();
            for (combine, q) in [
                (Combine::Roll, [s, 0.0, 0.0, c]),
                (Combine::Pitch, [0.0, s, 0.0, c]),
                (Combine::Yaw, [0.0, 0.0, s, c]),
            ] {
                assert!((combine.value(&q).unwrap() - angle).abs() < 1e-12);
            }
        }
        assert_eq!(Combine::Curvature.value(&[0.5, 1.0]), Some(2.0));
        assert_eq!(Combine::Curvature.value(&[0.0, 1.0]), Some(0.0));
        assert_eq!(Combine::Time.value(&[2.0, 5.0]), Some(2e9 + 5.0));
    }
}
