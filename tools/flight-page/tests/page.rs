//! Pages of recordings that nobody drove.

#![cfg(test)]

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};

use bytemuck::bytes_of;
use roxmltree::{Document as Xml, ParsingOptions};
use tempfile::TempDir;
use vigil_blocks::{
    Action, Block, Cause, DetectionBelief, FaultBelief, FaultRecord, FaultSource, FaultState,
    Faults, Header, Health, OverallState, RecoveryKind, SensorFrame,
};
use vigil_cycle::topic::{ServiceName, Topic};
use vigil_flight::FlightWriter;
use vigil_robot::channel::hash;
use vigil_setup::{Document, Setup};
use vigil_timeline::{TimelineEntry, WallClock};

const MS: u64 = 1_000_000;
const BEGIN_NS: u64 = 5_000 * MS;
const FAULT: &str = "RM_STUCK";

/// What a drive is like.
#[derive(Clone, Copy)]
struct Drive {
    cycles: u64,
    onset: u64,
    is_diagnosed: bool,
    is_located: bool,
}

const BROKEN: Drive = Drive {
    cycles: 200,
    onset: 120,
    is_diagnosed: true,
    is_located: true,
};

fn header<B: Block>(cycle: u64) -> Header {
    let t_ns = BEGIN_NS + cycle * 50 * MS;
    Header {
        schema: B::SCHEMA,
        epoch: 1,
        // Two numbers are missing.
        seq: cycle + 2 * u64::from(cycle > 50),
        t_schedule_ns: t_ns,
        t_capture_ns: t_ns,
        t_publish_ns: t_ns + MS,
    }
}

fn frame(cycle: u64, drive: Drive, graph: &Setup) -> SensorFrame {
    let mut frame = SensorFrame {
        header: header::<SensorFrame>(cycle),
        robot_hash: hash(&graph.robot),
        ..SensorFrame::default()
    };
    if drive.is_located {
        let angle = cycle as f64 * 0.02;
        let hole = if cycle == 70 { f64::NAN } else { 0.0 };
        frame.set_channel(0, 2.0 * angle.sin() + hole);
        frame.set_channel(1, 2.0 - 2.0 * angle.cos());
    }
    frame
}

fn write_diagnosis(writer: &mut FlightWriter, cycle: u64, drive: Drive, graph: &Setup) {
    let is_broken = cycle >= drive.onset;
    let node = graph.tree.index(FAULT).unwrap();
    let p = if is_broken { 0.97 } else { 0.0 };
    let detection = DetectionBelief {
        header: header::<DetectionBelief>(cycle),
        p_fault: if cycle == 30 { f64::NAN } else { p },
        alarm: is_broken.into(),
        ..DetectionBelief::default()
    };
    writer
        .block(Topic::Detection, bytes_of(&detection))
        .unwrap();
    let mut belief = FaultBelief {
        header: header::<FaultBelief>(cycle),
        tree_hash: graph.tree.hash(),
        ..FaultBelief::default()
    };
    (belief.p[0], belief.p[node]) = (1.0 - p, p);
    writer.block(Topic::Diagnosis, bytes_of(&belief)).unwrap();
    let kind = if is_broken {
        RecoveryKind::Stop
    } else {
        RecoveryKind::GoOn
    };
    let action = Action {
        header: header::<Action>(cycle),
        cause: Cause {
            kind: 1,
            ..Cause::default()
        },
        model_hash: graph.decision.hash(),
        action: is_broken.into(),
        alarm: is_broken.into(),
        kind: kind as u32,
        ..Action::default()
    };
    writer.block(Topic::Action, bytes_of(&action)).unwrap();
    let mut faults = Faults {
        header: header::<Faults>(cycle),
        tree_hash: graph.tree.hash(),
        overall: OverallState::Ok as u32,
        ..Faults::default()
    };
    if is_broken {
        faults.overall = OverallState::Fault as u32;
        faults.records[0] = FaultRecord {
            number: 1,
            p,
            source: FaultSource::Robot as u32,
            what: node as u32,
            state: FaultState::Active as u32,
            changed_ns: header::<Faults>(drive.onset).t_publish_ns,
            ..FaultRecord::default()
        };
    }
    writer.block(Topic::Faults, bytes_of(&faults)).unwrap();
}

/// Writes the recording of a drive.
fn write(folder: &TempDir, drive: Drive) -> PathBuf {
    let config = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../config/rover.toml");
    let document = Document::read(&config, |_| {}).unwrap();
    let graph = document.check().unwrap();
    let path = folder.path().join("<a>.mcap");
    let clock = WallClock::ahead_by(1_700_000_000_000_000_000);
    let mut writer = FlightWriter::create(&path, &graph, clock).unwrap();
    let text = document.to_text().unwrap();
    let attached = writer.attach("document.toml", "application/toml", text.as_bytes());
    attached.unwrap();
    let why = [("reason", "request"), ("what", "an <odd> noise & more")];
    let why = why.map(|(name, value)| (name.to_owned(), value.to_owned()));
    writer.metadata("vigil", &BTreeMap::from(why)).unwrap();
    for cycle in 0..drive.cycles {
        let frame = frame(cycle, drive, &graph);
        writer.block(Topic::Sensor, bytes_of(&frame)).unwrap();
        if drive.is_diagnosed {
            write_diagnosis(&mut writer, cycle, drive, &graph);
        }
        let health = Health {
            header: header::<Health>(cycle),
            cycles: cycle,
            missed: cycle / 60,
            last_cycle_ns: 200_000,
            deadline_ns: 20 * MS,
            ..Health::default()
        };
        let topic = Topic::Health(ServiceName::Supervisor);
        writer.block(topic, bytes_of(&health)).unwrap();
    }
    let entry = TimelineEntry {
        t_ns: BEGIN_NS + 6_100 * MS,
        wall: clock.rfc3339(BEGIN_NS + 6_100 * MS),
        service: "detector".to_owned(),
        event: "alarm".to_owned(),
        what: "<b>".to_owned(),
        ..TimelineEntry::default()
    };
    writer.event(&entry).unwrap();
    writer.finish().unwrap();
    path
}

/// What every page has to be.
fn check(html: &str) {
    let options = ParsingOptions {
        allow_dtd: true,
        ..ParsingOptions::default()
    };
    let page = Xml::parse_with_options(html, options).unwrap();
    let ids = page.descendants().filter_map(|node| node.attribute("id"));
    let ids: Vec<&str> = ids.collect();
    let unlike: BTreeSet<&&str> = ids.iter().collect();
    assert_eq!(unlike.len(), ids.len());
    for link in page.descendants().filter_map(|node| node.attribute("href")) {
        let id = link.strip_prefix('#').unwrap();
        assert!(ids.contains(&id), "{link}");
    }
    for node in page.descendants() {
        for attribute in node.attributes() {
            let value = attribute.value();
            let is_number = !value.contains("NaN") && !value.contains("inf,");
            assert!(is_number, "{}={value}", attribute.name());
        }
    }
    for outside in ["http://", "https://", "src=", "<script", "<link", "@import"] {
        assert!(!html.contains(outside), "{outside}");
    }
    assert!(html.len() < 2_000_000);
}

#[test]
fn a_drive_with_a_fault_has_a_page_that_names_it() {
    let folder = tempfile::tempdir().unwrap();
    let html = vigil_flight_page::page(&write(&folder, BROKEN)).unwrap();
    check(&html);
    for wanted in [
        "This was wrong: RM_STUCK since 6.0 s (22:13:31 UTC), with a probability of up to 0.970.",
        "What was done: ",
        "At the end RM_STUCK is active",
        "an &lt;odd&gt; noise &amp; more",
        "alarm &lt;b&gt;",
        "alarm, 6.0 s",
        "RM_STUCK is active</span>",
        "<td>51 to 52</td><td>2</td>",
        "Cycles missed so far",
        "2023-11-14 22:13:25.001 UTC",
    ] {
        assert!(html.contains(wanted), "{wanted}");
    }
}

#[test]
fn drives_without_a_fault_a_diagnosis_a_pose_or_anything_have_pages() {
    let folder = tempfile::tempdir().unwrap();
    let page = |drive: Drive| {
        let html = vigil_flight_page::page(&write(&folder, drive)).unwrap();
        check(&html);
        html
    };
    let healthy = page(Drive {
        onset: 999,
        ..BROKEN
    });
    assert!(healthy.contains("Nothing was wrong: no alarm and no fault in "));
    let undiagnosed = page(Drive {
        is_diagnosed: false,
        ..BROKEN
    });
    assert!(undiagnosed.contains("The recording holds no diagnosis"));
    let nowhere = page(Drive {
        is_located: false,
        ..BROKEN
    });
    assert!(nowhere.contains("No pose was measured"));
    let empty = page(Drive {
        cycles: 0,
        ..BROKEN
    });
    assert!(empty.contains("The recording holds no diagnosis"));
}

#[test]
fn a_cut_or_damaged_recording_has_a_page_of_what_is_there_and_other_files_have_none() {
    let folder = tempfile::tempdir().unwrap();
    let path = write(&folder, BROKEN);
    let whole = fs::read(&path).unwrap();
    fs::write(&path, &whole[..whole.len() * 3 / 4]).unwrap();
    let html = vigil_flight_page::page(&path).unwrap();
    check(&html);
    assert!(html.contains("The file is cut short"));
    let mut damaged = whole.clone();
    damaged[whole.len() * 3 / 4] ^= 1;
    fs::write(&path, &damaged).unwrap();
    let html = vigil_flight_page::page(&path).unwrap();
    check(&html);
    assert!(html.contains("The file is damaged"));
    fs::write(&path, "t_s,x_m\n").unwrap();
    let error = vigil_flight_page::page(&path).unwrap_err();
    assert!(error.to_string().ends_with("is no MCAP file"));
}
