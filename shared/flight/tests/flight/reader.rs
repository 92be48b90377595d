//! Recordings are read as they were written, and damaged ones as far as they go.

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;

use bytemuck::bytes_of;
use proptest::prelude::*;
use vigil_blocks::{Block, DetectionBelief, Header, Health, SensorFrame};
use vigil_cycle::topic::{ServiceName, Topic};
use vigil_flight::{FlightError, FlightReader, FlightWriter, Recorded, has_end, mend, read_block};
use vigil_timeline::{TimelineEntry, WallClock};

const MS: u64 = 1_000_000;
const DOCUMENT: &str = "[graph]\nname = \"a\"\n";

fn header<B: Block>(t_ns: u64) -> Header {
    Header {
        schema: B::SCHEMA,
        epoch: 1,
        seq: t_ns / MS,
        t_schedule_ns: t_ns,
        t_capture_ns: t_ns,
        t_publish_ns: t_ns,
    }
}

/// What a recording holds: topic or `events`, time and bytes, or the event's words.
type Entry = (String, u64, Vec<u8>);

/// Writes a recording with several chunks; what is in it.
fn write(path: &Path) -> Vec<Entry> {
    let config = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../config/rover.toml");
    let graph = vigil_setup::load_graph(&config, |_| {}).unwrap();
    let mut writer = FlightWriter::create(path, &graph, WallClock::ahead_by(7)).unwrap();
    let why = BTreeMap::from([("reason".to_owned(), "alarm".to_owned())]);
    writer
        .attach("document.toml", "application/toml", DOCUMENT.as_bytes())
        .unwrap();
    writer.metadata("vigil", &why).unwrap();
    let mut told = Vec::new();
    let mut put = |writer: &mut FlightWriter, topic: Topic, t_ns: u64, bytes: &[u8]| {
        writer.block(topic, bytes).unwrap();
        told.push((topic.name(), t_ns + 7, bytes.to_vec()));
    };
    for i in 1..6 {
        let t_ns = i * 700 * MS;
        let frame = SensorFrame {
            header: header::<SensorFrame>(t_ns),
            ..SensorFrame::default()
        };
        put(&mut writer, Topic::Sensor, t_ns, bytes_of(&frame));
        let detection = DetectionBelief {
            header: header::<DetectionBelief>(t_ns),
            p_fault: i as f64,
            ..DetectionBelief::default()
        };
        put(&mut writer, Topic::Detection, t_ns, bytes_of(&detection));
        let health = Health {
            header: header::<Health>(t_ns),
            ..Health::default()
        };
        let topic = Topic::Health(ServiceName::Detector);
        put(&mut writer, topic, t_ns, bytes_of(&health));
        // Of another version.
        writer.block(Topic::Sensor, b"what is that?").unwrap();
    }
    let entry = TimelineEntry {
        t_ns: 3_500 * MS,
        event: "alarm".to_owned(),
        ..TimelineEntry::default()
    };
    writer.event(&entry).unwrap();
    told.push(("events".to_owned(), 3_500 * MS + 7, b"alarm".to_vec()));
    writer.finish().unwrap();
    told
}

fn read(reader: &mut FlightReader) -> Result<Vec<Entry>, FlightError> {
    let mut told = Vec::new();
    while let Some(recorded) = reader.next()? {
        told.push(match recorded {
            Recorded::Block {
                topic,
                log_time_ns,
                bytes,
            } => (topic.name(), log_time_ns, bytes.to_vec()),
            Recorded::Event { log_time_ns, entry } => {
                ("events".to_owned(), log_time_ns, entry.event.into())
            }
        });
    }
    Ok(told)
}

#[test]
fn what_was_written_is_read_in_its_order() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.mcap");
    let told = write(&path);
    let mut reader = FlightReader::open(&path).unwrap();
    assert_eq!(reader.document(), Some(DOCUMENT));
    assert_eq!(reader.about()["reason"], "alarm");
    let found = read(&mut reader).unwrap();
    assert!(!reader.is_cut());
    assert_eq!(reader.foreign_count(), 5);
    assert_eq!(found, told);
    let detection: DetectionBelief = read_block(&found[4].2).unwrap();
    assert_eq!(detection.p_fault, 2.0);
    assert_eq!(read_block::<SensorFrame>(&found[4].2), None);
    assert_eq!(reader.next().unwrap(), None, "the end stays the end");
    // This document is too short for a graph.
    let error = reader.setup().map(|_| ()).unwrap_err().to_string();
    let begin = format!("what the graph ran on cannot be read: {}", path.display());
    assert!(error.starts_with(&begin), "{error}");
}

/// A cut file can be made whole: it holds the same, says that it was cut, and has an end and an
/// index for other readers.
fn assert_mended(cut: &Path, before: &FlightReader, found: &[Entry]) {
    let whole = cut.with_extension("whole");
    if found.is_empty() {
        let error = mend(cut, &whole).unwrap_err().to_string();
        assert!(error.ends_with("nothing in it is whole") && !whole.exists());
        return;
    }
    let mended = mend(cut, &whole).unwrap();
    assert_eq!(mended.damage, None);
    assert!(matches!(mend(&whole, cut), Err(FlightError::Whole { .. })));
    let content = fs::read(&whole).unwrap();
    assert!(mcap::Summary::read(&content).unwrap().is_some());
    let others = mcap::MessageStream::new(&content).unwrap();
    assert!(others.map(Result::unwrap).count() >= found.len());
    let mut reader = FlightReader::open(&whole).unwrap();
    assert_eq!(read(&mut reader).unwrap(), found);
    assert!(reader.is_cut());
    assert_eq!(reader.document(), before.document());
    assert_eq!(reader.about().get("reason"), before.about().get("reason"));
}

#[test]
fn a_file_that_is_cut_gives_its_whole_chunks_and_its_document() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.mcap");
    let told = write(&path);
    let content = fs::read(&path).unwrap();
    let cut = folder.path().join("b-cut.mcap");
    let mut counts = Vec::new();
    for length in (16..content.len()).step_by(97) {
        fs::write(&cut, &content[..length]).unwrap();
        let Ok(mut reader) = FlightReader::open(&cut) else {
            assert!(length < 100, "{length}");
            continue;
        };
        let found = read(&mut reader).unwrap();
        assert!(reader.is_cut());
        assert!(found.is_empty() || reader.document().is_some());
        assert_eq!(found[..], told[..found.len()]);
        counts.push(found.len());
        assert_mended(&cut, &reader, &found);
    }
    assert!(counts.is_sorted());
    assert_eq!(counts.last(), Some(&told.len()));
}

#[test]
fn other_files_are_refused_by_name() {
    let folder = tempfile::tempdir().unwrap();
    let refusal = |name: &str, content: &[u8]| {
        let path = folder.path().join(name);
        fs::write(&path, content).unwrap();
        let error = FlightReader::open(&path).map(|_| ()).unwrap_err();
        let text = error.to_string();
        assert!(text.contains(name), "{text}");
        text
    };
    assert!(refusal("none", b"").ends_with("is no MCAP file"));
    assert!(refusal("text", b"t_s,x_m,y_m\n0,0,0\n").ends_with("is no MCAP file"));
    let mut other = Vec::new();
    let options = mcap::WriteOptions::new().library("another");
    let mut writer = options.create(std::io::Cursor::new(&mut other)).unwrap();
    let channel = writer.add_channel(0, "/odom", "json", &BTreeMap::new());
    let header = mcap::records::MessageHeader {
        channel_id: channel.unwrap(),
        sequence: 0,
        log_time: 1,
        publish_time: 1,
    };
    writer.write_to_known_channel(&header, b"{}").unwrap();
    writer.finish().unwrap();
    drop(writer);
    assert!(refusal("other.mcap", &other).ends_with("but no recording of Vigil"));
    let missing = FlightReader::open(Path::new("/missing.mcap")).map(|_| ());
    let text = missing.unwrap_err().to_string();
    assert!(text.starts_with("cannot read /missing.mcap: "), "{text}");
}

/// Changes a bit of the last detection; where that is, and the file's new content.
fn damage(path: &Path) -> (usize, Vec<u8>) {
    let mut content = fs::read(path).unwrap();
    let is_last = |at: &usize| content[*at..].starts_with(bytes_of(&5.0_f64));
    let at = (0..content.len()).rev().find(is_last).unwrap();
    content[at] ^= 1;
    fs::write(path, &content).unwrap();
    (at, content)
}

#[test]
fn of_a_damaged_file_with_an_end_what_comes_before_the_damage_is_kept() {
    let folder = tempfile::tempdir().unwrap();
    let [path, whole] = ["a.mcap", "b.mcap"].map(|name| folder.path().join(name));
    let told = write(&path);
    let (at, mut content) = damage(&path);
    assert!(has_end(&path).unwrap());
    let mended = mend(&path, &whole).unwrap();
    assert!(mended.damage.is_some() && mended.messages > 0);
    let found = read(&mut FlightReader::open(&whole).unwrap()).unwrap();
    assert!(!found.is_empty() && found.len() < told.len());
    assert_eq!(found[..], told[..found.len()]);
    // A loss of power may leave zeros.
    let cut = folder.path().join("c.mcap");
    content.truncate(at);
    content.resize(at + 4096, 0);
    fs::write(&cut, &content).unwrap();
    mend(&cut, &whole).unwrap();
    let after = read(&mut FlightReader::open(&whole).unwrap()).unwrap();
    assert_eq!(after, found);
}

#[test]
fn a_chunk_with_another_byte_is_found_and_what_came_before_it_stays() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.mcap");
    let told = write(&path);
    damage(&path);
    let mut reader = FlightReader::open(&path).unwrap();
    let mut count = 0;
    let error = loop {
        match reader.next() {
            Ok(Some(_)) => count += 1,
            Ok(None) => panic!("the damage was not found"),
            Err(error) => break error.to_string(),
        }
    };
    assert!(error.ends_with("a.mcap is damaged: the checksum of a chunk does not fit"));
    assert!(count > 0 && count < told.len());
    assert_eq!(reader.next().unwrap(), None);
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(300))]

    #[test]
    fn no_damage_ends_the_process(
        changes in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 0..12),
        zeros in prop::option::of((any::<prop::sample::Index>(), 1_usize..12)),
        cut in prop::option::of(any::<prop::sample::Index>()),
    ) {
        static WHOLE: std::sync::OnceLock<Vec<u8>> = std::sync::OnceLock::new();
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.mcap");
        let mut content = WHOLE.get_or_init(|| {
            write(&path);
            fs::read(&path).unwrap()
        }).clone();
        for (at, byte) in changes {
            let at = at.index(content.len());
            content[at] = byte;
        }
        if let Some((at, count)) = zeros {
            let at = at.index(content.len());
            let end = content.len().min(at + count);
            content[at..end].fill(0);
        }
        if let Some(cut) = cut {
            content.truncate(cut.index(content.len()));
        }
        fs::write(&path, &content).unwrap();
        if let Ok(mut reader) = FlightReader::open(&path) {
            let _ = read(&mut reader);
        }
        let whole = path.with_extension("whole");
        if mend(&path, &whole).is_ok() {
            let mended = fs::read(&whole).unwrap();
            prop_assert!(mcap::Summary::read(&mended).unwrap().is_some());
        }
    }
}
