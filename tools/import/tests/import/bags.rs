//! Recordings of ROS 2: both containers, compressed, split, cut off; and what is refused.
use std::collections::BTreeMap;
use std::fs;
use std::path::Path;

use mcap::records::MessageHeader;
use tempfile::TempDir;
use vigil_import::{ImportError, ImportedLog, LogDescription, import};
use vigil_robot::Description;

const ROBOT: &str = r#"
name = "small"
kinematics = "differential"
wheel_radius_m = 0.1
noise = "estimate"
command = [{ name = "v", unit = "m/s", limit = 1.0 }, { name = "w", unit = "rad/s", limit = 2.0 }]
wheels = [
  { name = "L", x = 0.0, y = 0.1, steered = false },
  { name = "R", x = 0.0, y = -0.1, steered = false },
]
measured = { pose = false, wheel_rates = true, steer = false, yaw_rate = false, currents = false }
limits = { speed_m_s = 1.0, yaw_rate_rad_s = 2.0, wheel_rate_rad_s = 50.0 }
"#;

/// A log of these runs, the right wheel's joint called `right`.
fn log(runs: &str, right: &str) -> LogDescription {
    let text = format!(
        r#"
robot = "robot.toml"
rate_hz = 20.0
runs = ["{runs}"]
[[source]]
name = "joints"
topic = "/joint_states"
time = {{ column = "stamp", unit = "ns" }}
[[source]]
name = "command"
topic = "/cmd_vel"
time = {{ column = "stamp", unit = "ns" }}
[[channel]]
name = "v"
source = "command"
column = "linear.x"
method = "hold"
[[channel]]
name = "w"
source = "command"
column = "angular.z"
method = "hold"
[[channel]]
name = "enc_L"
source = "joints"
column = "velocity[left]"
[[channel]]
name = "enc_R"
source = "joints"
column = "velocity[{right}]"
"#
    );
    toml::from_str(&text).unwrap()
}

fn imported(folder: &Path, runs: &str, right: &str) -> Result<ImportedLog, ImportError> {
    let robot: Description = toml::from_str(ROBOT).unwrap();
    import(&log(runs, right), &robot, folder)
}

/// CDR, little-endian: numbers at multiples of their size, counted after the encapsulation.
struct Cdr(Vec<u8>);

impl Cdr {
    fn new() -> Self {
        Self(vec![0, 1, 0, 0])
    }

    fn put(&mut self, bytes: &[u8]) {
        while !(self.0.len() - 4).is_multiple_of(bytes.len()) {
            self.0.push(0);
        }
        self.0.extend(bytes);
    }

    fn text(&mut self, text: &str) {
        self.put(&(text.len() as u32 + 1).to_le_bytes());
        self.0.extend(text.bytes().chain([0]));
    }

    fn numbers(&mut self, values: &[f64]) {
        self.put(&(values.len() as u32).to_le_bytes());
        values
            .iter()
            .for_each(|value| self.put(&value.to_le_bytes()));
    }
}

/// A message: topic, type, time of recording ns, content.
type Sent = (&'static str, &'static str, u64, Vec<u8>);

/// Ten seconds at 20 Hz: joints with stamps, and a twist without one.
fn messages() -> Vec<Sent> {
    let mut all = Vec::new();
    for i in 0..200_u32 {
        let t_ns = 1_000_000_000_000 + u64::from(i) * 50_000_000;
        let mut joints = Cdr::new();
        joints.put(&((t_ns / 1_000_000_000) as u32).to_le_bytes());
        joints.put(&((t_ns % 1_000_000_000) as u32).to_le_bytes());
        joints.text("base");
        joints.put(&2_u32.to_le_bytes());
        joints.text("left");
        joints.text("right");
        joints.numbers(&[]);
        joints.numbers(&[f64::from(i), -f64::from(i)]);
        joints.numbers(&[]);
        all.push((
            "/joint_states",
            "sensor_msgs/msg/JointState",
            t_ns,
            joints.0,
        ));
        let mut twist = Cdr::new();
        for value in [0.5, 0.0, 0.0, 0.0, 0.0, f64::from(i % 7)] {
            twist.put(&value.to_le_bytes());
        }
        all.push(("/cmd_vel", "geometry_msgs/msg/Twist", t_ns, twist.0));
    }
    all
}

fn write_mcap(path: &Path, messages: &[Sent]) {
    let file = fs::File::create(path).unwrap();
    let options = mcap::WriteOptions::new()
        .compression(None)
        .chunk_size(Some(4096));
    let mut writer = options.create(file).unwrap();
    for (sequence, (topic, kind, t_ns, data)) in messages.iter().enumerate() {
        let schema = writer.add_schema(kind, "ros2msg", &[]).unwrap();
        let channel_id = writer
            .add_channel(schema, topic, "cdr", &BTreeMap::new())
            .unwrap();
        let header = MessageHeader {
            channel_id,
            sequence: sequence as u32,
            log_time: *t_ns,
            publish_time: *t_ns,
        };
        writer.write_to_known_channel(&header, data).unwrap();
    }
    writer.finish().unwrap();
}

fn write_sqlite(path: &Path, messages: &[Sent]) {
    let bag = rusqlite::Connection::open(path).unwrap();
    bag.execute_batch(
        "CREATE TABLE topics (id INTEGER PRIMARY KEY, name TEXT, type TEXT);
         CREATE TABLE messages (id INTEGER PRIMARY KEY, topic_id INTEGER, timestamp INTEGER,
                                data BLOB);
         INSERT INTO topics VALUES (1, '/joint_states', 'sensor_msgs/msg/JointState');
         INSERT INTO topics VALUES (2, '/cmd_vel', 'geometry_msgs/msg/Twist');
         BEGIN",
    )
    .unwrap();
    for (topic, _, t_ns, data) in messages {
        let id = if *topic == "/cmd_vel" { 2 } else { 1 };
        let sql = "INSERT INTO messages (topic_id, timestamp, data) VALUES (?1, ?2, ?3)";
        bag.execute(sql, rusqlite::params![id, *t_ns as i64, data])
            .unwrap();
    }
    bag.execute_batch("COMMIT").unwrap();
}

#[test]
fn both_containers_compressed_or_split_give_the_same_frames() {
    let folder = TempDir::new().unwrap();
    let at = |name: &str| folder.path().join(name);
    let sent = messages();
    write_mcap(&at("a.mcap"), &sent);
    write_sqlite(&at("b.db3"), &sent);
    let plain = fs::read(at("b.db3")).unwrap();
    fs::write(
        at("c.db3.zstd"),
        zstd::encode_all(plain.as_slice(), 1).unwrap(),
    )
    .unwrap();
    fs::create_dir(at("drive")).unwrap();
    fs::write(at("drive").join("metadata.yaml"), "").unwrap();
    // Eleven files, so that their order is not that of their names.
    for (i, part) in sent.chunks(sent.len().div_ceil(11)).enumerate() {
        write_mcap(&at("drive").join(format!("drive_{i}.mcap")), part);
    }
    let first = imported(folder.path(), "a.mcap", "right").unwrap();
    let [run] = first.runs.as_slice() else {
        unreachable!("one run");
    };
    // The last of the 200 samples has no successor to be interpolated with.
    assert_eq!(run.rows.len(), 199);
    for (i, row) in run.rows.iter().enumerate() {
        let i = i as f64;
        assert_eq!(row[1..], [0.5, i % 7.0, i, -i], "row {i}");
    }
    assert_eq!(run.unstamped, ["/cmd_vel"]);
    for name in ["b.db3", "c.db3.zstd", "drive"] {
        let other = imported(folder.path(), name, "right").unwrap();
        assert_eq!(other.runs[0].rows, run.rows, "{name}");
        assert_eq!(other.runs[0].cut, [], "{name}");
        assert_eq!(other.runs[0].disorder, [], "{name}");
    }
}

#[test]
fn of_a_recording_that_is_cut_off_the_beginning_is_used_and_the_cut_told() {
    let folder = TempDir::new().unwrap();
    write_mcap(&folder.path().join("whole.mcap"), &messages());
    let whole = fs::read(folder.path().join("whole.mcap")).unwrap();
    let all = imported(folder.path(), "whole.mcap", "right").unwrap();
    let mut lengths = Vec::new();
    for share in [3, 5, 7] {
        let cut = folder.path().join("cut.mcap");
        fs::write(&cut, &whole[..whole.len() * share / 10]).unwrap();
        let run = imported(folder.path(), "cut.mcap", "right")
            .unwrap()
            .runs
            .remove(0);
        assert_eq!(run.rows, all.runs[0].rows[..run.rows.len()]);
        let [found] = run.cut.as_slice() else {
            unreachable!("the cut of {share} tenths is told");
        };
        assert_eq!(found.path, cut);
        assert!(found.messages > 0);
        lengths.push(run.rows.len());
    }
    assert!(
        lengths.is_sorted() && lengths[0] > 20 && lengths[2] < 199,
        "{lengths:?}"
    );
}

#[test]
fn what_is_wrong_is_told_with_what_there_is() {
    let folder = TempDir::new().unwrap();
    write_sqlite(&folder.path().join("a.db3"), &messages());
    let error = imported(folder.path(), "a.db3", "rihgt")
        .unwrap_err()
        .to_string();
    assert!(
        error.contains("velocity[rihgt]") && error.contains("velocity[left], velocity[right]"),
        "{error}"
    );
    fs::create_dir(folder.path().join("empty")).unwrap();
    let error = imported(folder.path(), "empty", "right")
        .unwrap_err()
        .to_string();
    assert!(error.contains("no .mcap or .db3 file"), "{error}");
    fs::write(folder.path().join("text.db3"), "nothing like it").unwrap();
    let error = imported(folder.path(), "text.db3", "right")
        .unwrap_err()
        .to_string();
    assert!(error.contains("neither MCAP nor SQLite"), "{error}");
    // A SQLite file of something else, and one that is damaged.
    let bytes = fs::read(folder.path().join("a.db3")).unwrap();
    fs::write(folder.path().join("cut.db3"), &bytes[..bytes.len() / 2]).unwrap();
    let other = rusqlite::Connection::open(folder.path().join("other.db3")).unwrap();
    other
        .execute_batch("CREATE TABLE notes (text TEXT)")
        .unwrap();
    for name in ["cut.db3", "other.db3"] {
        let error = imported(folder.path(), name, "right")
            .unwrap_err()
            .to_string();
        assert!(error.contains("SQLite"), "{name}: {error}");
    }
}
