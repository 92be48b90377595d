//! Files are written from blocks and read again.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

use bytemuck::bytes_of;
use mcap::read::Options;
use mcap::{Message, MessageStream, Summary};
use vigil_blocks::{
    Action, Block, DetectionBelief, FaultBelief, Faults, Header, Health, ParticleBlock, SensorFrame,
};
use vigil_cycle::topic::{ServiceName, Topic};
use vigil_flight::FlightWriter;
use vigil_robot::channel::hash;
use vigil_setup::Setup;
use vigil_timeline::{TimelineEntry, WallClock};

const S: u64 = 1_000_000_000;
const MS: u64 = 1_000_000;
const AHEAD_NS: u64 = 1_700_000_000 * S;

fn setup() -> Setup {
    let config = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../config/rover.toml");
    vigil_setup::load_graph(&config, |_| {}).unwrap()
}

struct Flight {
    folder: tempfile::TempDir,
    graph: Setup,
    writer: FlightWriter,
}

impl Flight {
    fn new() -> Self {
        let (folder, graph) = (tempfile::tempdir().unwrap(), setup());
        let clock = WallClock::ahead_by(i128::from(AHEAD_NS));
        let writer = FlightWriter::create(&folder.path().join("a.mcap"), &graph, clock).unwrap();
        Self {
            folder,
            graph,
            writer,
        }
    }

    fn path(&self) -> PathBuf {
        self.folder.path().join("a.mcap")
    }

    fn part(&self) -> PathBuf {
        self.folder.path().join("a.mcap.part")
    }

    fn put<B: Block>(&mut self, topic: Topic, block: &B) {
        self.writer.block(topic, bytes_of(block)).unwrap();
    }

    /// A frame of the graph's robot that was captured at `t_ns`.
    fn frame(&self, t_ns: u64) -> SensorFrame {
        let mut frame = SensorFrame {
            header: header::<SensorFrame>(t_ns),
            robot_hash: hash(&self.graph.robot),
            ..SensorFrame::default()
        };
        for place in 0..13 {
            frame.set_channel(place, place as f64 + 0.5);
        }
        frame
    }
}

/// A block's head; it was published a millisecond after `t_ns`.
fn header<B: Block>(t_ns: u64) -> Header {
    Header {
        schema: B::SCHEMA,
        epoch: 1,
        seq: t_ns / MS,
        t_schedule_ns: t_ns,
        t_capture_ns: t_ns,
        t_publish_ns: t_ns + MS,
    }
}

fn messages(content: &[u8], options: Options) -> Vec<Message<'_>> {
    let stream = MessageStream::new_with_options(content, options.into()).unwrap();
    stream.map_while(Result::ok).collect()
}

fn on<'a, 'b>(topic: &'a str, all: &'a [Message<'b>]) -> Vec<&'a Message<'b>> {
    let found = all.iter().filter(|message| message.channel.topic == topic);
    found.collect()
}

fn u32_at(bytes: &[u8], at: usize) -> u32 {
    u32::from_le_bytes(bytes[at..at + 4].try_into().unwrap())
}

#[test]
fn a_file_holds_every_block_as_it_was_and_its_messages_at_its_time() {
    let mut flight = Flight::new();
    let frame = flight.frame(5 * S);
    flight.put(Topic::Sensor, &frame);
    let particles = ParticleBlock {
        header: header::<ParticleBlock>(5 * S),
        ..ParticleBlock::default()
    };
    flight.put(Topic::DetectionParticles, &particles);
    let path = flight.path();
    let summary = flight.writer.finish().unwrap();
    let content = fs::read(&path).unwrap();
    assert_eq!(summary.bytes, content.len() as u64);
    assert_eq!(summary.first_unix_ns, Some(AHEAD_NS + 5 * S + MS));
    assert_eq!(summary.raw_only, 0);

    let all = messages(&content, Options::IgnoreEndMagic);
    assert_eq!(summary.messages.values().sum::<u64>(), all.len() as u64);
    let raw = on("/vigil/raw/sensor", &all);
    assert_eq!(raw[0].data[..], *bytes_of(&frame));
    assert_eq!(raw[0].log_time, AHEAD_NS + 5 * S + MS);
    assert_eq!(raw[0].publish_time, AHEAD_NS + 5 * S);
    assert_eq!(raw[0].sequence, 5_000);
    let schema = raw[0].channel.schema.as_ref().unwrap();
    assert_eq!(schema.name, SensorFrame::TYPE_NAME);
    assert_eq!(raw[0].channel.message_encoding, "vigil-block");
    assert!(raw[0].channel.metadata["layout"].contains("\n0 header: Header\n"));
    let raw = on("/vigil/raw/detection/particles", &all);
    assert_eq!(raw[0].data[..], *bytes_of(&particles));

    let odom = on("/odom", &all);
    let schema = odom[0].channel.schema.as_ref().unwrap();
    assert_eq!(
        [schema.name.as_str(), schema.encoding.as_str()],
        ["nav_msgs/msg/Odometry", "ros2msg"]
    );
    // Stamp, "odom" and "base_link", then x and y.
    let data = &odom[0].data;
    assert_eq!(u32_at(data, 4), (AHEAD_NS / S) as u32 + 5);
    assert_eq!(data[16..21], *b"odom\0");
    let f64_at = |at: usize| f64::from_le_bytes(data[at..at + 8].try_into().unwrap());
    assert_eq!([f64_at(44), f64_at(52)], [0.5, 1.5]);
}

#[test]
fn what_was_not_measured_is_nan_and_a_pose_that_was_not_is_left_out() {
    let mut flight = Flight::new();
    let mut frame = flight.frame(5 * S);
    frame.channel_valid &= !0b10_0010;
    flight.put(Topic::Sensor, &frame);
    let path = flight.path();
    flight.writer.finish().unwrap();
    let content = fs::read(&path).unwrap();
    let all = messages(&content, Options::IgnoreEndMagic);
    assert!(on("/odom", &all).is_empty() && on("/tf", &all).is_empty());
    let data = &on("/vigil/channels", &all)[0].data;
    let nan = data.windows(8).filter(|it| **it == f64::NAN.to_le_bytes());
    // Two that were taken away, and those of gyro and six currents.
    assert_eq!(nan.count(), 2 + 7);
}

#[test]
fn blocks_of_another_version_or_other_models_give_no_messages_and_are_counted() {
    let mut flight = Flight::new();
    let frame = flight.frame(5 * S);
    let strange = SensorFrame {
        robot_hash: 1,
        ..frame
    };
    flight.put(Topic::Sensor, &strange);
    flight.put(
        Topic::Diagnosis,
        &FaultBelief {
            header: header::<FaultBelief>(5 * S),
            ..FaultBelief::default()
        },
    );
    flight.put(
        Topic::Action,
        &Action {
            header: header::<Action>(5 * S),
            ..Action::default()
        },
    );
    // A block on the wrong topic, half a block, and no block at all.
    flight.put(Topic::Detection, &frame);
    let half = &bytes_of(&frame)[..100];
    flight.writer.block(Topic::Sensor, half).unwrap();
    flight.writer.block(Topic::Sensor, &[]).unwrap();
    let summary = flight.writer.finish().unwrap();
    assert_eq!(summary.raw_only, 6);
    let topics: Vec<&str> = summary.messages.keys().map(String::as_str).collect();
    assert_eq!(
        topics,
        [
            "/vigil/foreign/detection",
            "/vigil/foreign/sensor",
            "/vigil/raw/action",
            "/vigil/raw/diagnosis",
            "/vigil/raw/sensor",
        ]
    );
    assert_eq!(summary.messages["/vigil/foreign/sensor"], 2);
}

#[test]
fn a_file_that_is_cut_off_is_read_up_to_its_last_whole_second() {
    let mut flight = Flight::new();
    for i in 0..50 {
        let frame = flight.frame(5 * S + i * 100 * MS);
        flight.put(Topic::Sensor, &frame);
    }
    assert!(!flight.path().exists());
    // As after a power cut of the process: nobody has ended the file.
    let content = fs::read(flight.part()).unwrap();
    let all = messages(&content, Options::IgnoreEndMagic);
    assert_eq!(on("/vigil/raw/sensor", &all).len(), 40);
    assert_eq!(on("/odom", &all).len(), 40);
    flight.writer.flush().unwrap();
    let content = fs::read(flight.part()).unwrap();
    let all = messages(&content, Options::IgnoreEndMagic);
    assert_eq!(on("/odom", &all).len(), 50);
    // As after a full disk: within the last chunk.
    let cut = &content[..content.len() - 8_000];
    let found = on("/odom", &messages(cut, Options::IgnoreEndMagic)).len();
    assert!((40..50).contains(&found), "{found}");
    let (path, part) = (flight.path(), flight.part());
    flight.writer.finish().unwrap();
    assert!(path.exists() && !part.exists());
}

#[test]
fn large_blocks_are_flushed_by_size() {
    let mut flight = Flight::new();
    for i in 0..12 {
        let particles = ParticleBlock {
            header: header::<ParticleBlock>(5 * S + i * MS),
            ..ParticleBlock::default()
        };
        flight.put(Topic::DiagnosisParticles, &particles);
    }
    let content = fs::read(flight.part()).unwrap();
    let all = messages(&content, Options::IgnoreEndMagic);
    assert_eq!(on("/vigil/raw/diagnosis/particles", &all).len(), 10);
}

#[test]
fn events_attachments_and_metadata_are_found_again() {
    let mut flight = Flight::new();
    let entry = TimelineEntry {
        t_s: Some(1.5),
        t_ns: 6 * S,
        service: "detector".to_owned(),
        event: "alarm".to_owned(),
        p: Some(0.99),
        ..TimelineEntry::default()
    };
    let why = BTreeMap::from([("reason".to_owned(), "alarm".to_owned())]);
    flight.writer.metadata("vigil", &why).unwrap();
    let attached = b"[graph]\n";
    let writer = &mut flight.writer;
    writer
        .attach("graph.toml", "application/toml", attached)
        .unwrap();
    flight.writer.event(&entry).unwrap();
    let path = flight.path();
    flight.writer.finish().unwrap();
    let content = fs::read(&path).unwrap();
    let all = messages(&content, Options::IgnoreEndMagic);
    let json = on("/vigil/raw/events", &all);
    let read: TimelineEntry = serde_json::from_slice(&json[0].data).unwrap();
    assert_eq!(read, entry);
    assert_eq!(json[0].log_time, AHEAD_NS + 6 * S);
    let log = on("/vigil/events", &all);
    assert_eq!(log[0].data[12], 30, "a warning");
    assert!(log[0].data.windows(7).any(|it| it == b"p=0.990"));

    let summary = Summary::read(&content).unwrap().unwrap();
    let index = &summary.attachment_indexes[0];
    let read = mcap::read::attachment(&content, index).unwrap();
    assert_eq!(read.data[..], *attached);
    assert_eq!(read.name, "graph.toml");
    let read = mcap::read::metadata(&content, &summary.metadata_indexes[0]).unwrap();
    assert_eq!(read.metadata, why);
}

#[test]
fn what_repeats_itself_is_thinned_out_and_changes_are_written_at_once() {
    let mut flight = Flight::new();
    for i in 0..100 {
        let t_ns = 5 * S + i * 10 * MS;
        let health = Health {
            header: header::<Health>(t_ns),
            degraded: u32::from(i >= 60),
            ..Health::default()
        };
        flight.put(Topic::Health(ServiceName::Detector), &health);
        flight.put(Topic::Health(ServiceName::Supervisor), &health);
        let belief = FaultBelief {
            header: header::<FaultBelief>(t_ns),
            tree_hash: flight.graph.tree.hash(),
            ..FaultBelief::default()
        };
        flight.put(Topic::Diagnosis, &belief);
        let faults = Faults {
            header: header::<Faults>(t_ns),
            tree_hash: flight.graph.tree.hash(),
            ..Faults::default()
        };
        flight.put(Topic::Faults, &faults);
        let belief = DetectionBelief {
            header: header::<DetectionBelief>(t_ns),
            ..DetectionBelief::default()
        };
        flight.put(Topic::Detection, &belief);
    }
    let summary = flight.writer.finish().unwrap();
    assert_eq!(summary.messages["/vigil/health"], 2 * 3);
    assert_eq!(summary.messages["/diagnostics"], 2);
    assert_eq!(summary.messages["/vigil/faults"], 2);
    assert_eq!(summary.messages["/vigil/belief"], 100);
    assert_eq!(summary.messages["/vigil/detection"], 100);
}

#[test]
fn a_folder_that_is_not_there_is_told_with_the_file() {
    let clock = WallClock::ahead_by(0);
    let error = FlightWriter::create(Path::new("missing/a.mcap"), &setup(), clock);
    let error = error.err().unwrap().to_string();
    assert!(error.contains("missing/a.mcap.part"), "{error}");
}
