//! What a graph has computed is computed again from its recording, to the last bit: from its start,
//! and from the states that it hands out, with every filter and policy.
#![cfg(test)]

mod graph;
#[path = "../virtual_graph/mod.rs"]
mod virtual_graph;

use std::path::Path;

use vigil_blocks::{ControlCommand, FaultBelief, FaultRecord, FaultState, Faults};
use vigil_cycle::Topic;
use vigil_cycle::topic::ServiceName;
use vigil_flight::{FlightReader, FlightWriter, Recorded};
use vigil_replay::{Difference, Replay, Tally, What};
use vigil_setup::Document;
use vigil_setup::graph_file::GraphFile;
use vigil_timeline::WallClock;

use graph::{Drive, Hiccup, now_and_then, record};

/// How a configuration is changed.
type Change = fn(&mut GraphFile);

const UNCHANGED: Change = |_| {};

const ROVER: Drive = Drive {
    config: "rover.toml",
    change: UNCHANGED,
    inject: &["stuck:RM@4", "encoder:LF:zero@16"],
    cycles: 2600,
    unrecorded: 0,
    hiccup: now_and_then,
};

/// What a replay has come to.
struct Replayed {
    tallies: [Tally; 3],
    first_difference: Option<(ServiceName, Difference)>,
    gaps: Vec<String>,
    /// True if an alarm, a fault's name, another action and an active fault were computed.
    had_a_fault: [bool; 4],
}

fn recorded(drive: &Drive) -> Replayed {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("drive.mcap");
    record(drive, &path);
    replay(&path)
}

fn replay(path: &Path) -> Replayed {
    let mut replay = Replay::open(path).unwrap();
    let (mut first_difference, mut gaps, mut had_a_fault) = (None, Vec::new(), [false; 4]);
    while let Some(moment) = replay.next_moment().unwrap() {
        match moment.what {
            What::Answered(answer, difference) => {
                let difference = difference.map(|it| (moment.service, it));
                first_difference = first_difference.or(difference);
                match answer {
                    vigil_replay::Answer::Detection(belief) => had_a_fault[0] |= belief.alarm != 0,
                    vigil_replay::Answer::Diagnosis(belief) => had_a_fault[1] |= belief.mode != 0,
                    vigil_replay::Answer::Action(action) => {
                        had_a_fault[2] |= action.decision_seq > 1
                    }
                    vigil_replay::Answer::Faults(faults) => {
                        let active = |it: &FaultRecord| it.state() == Some(FaultState::Active);
                        had_a_fault[3] |= faults.kept().any(active);
                    }
                }
            }
            What::StateDiffers(difference) => {
                first_difference.get_or_insert((moment.service, difference));
            }
            What::Gap(what) => gaps.push(format!("{}: {what}", moment.service.as_str())),
            What::Begins => {}
        }
    }
    Replayed {
        tallies: ServiceName::STEPPING.map(|service| replay.tally(service)),
        first_difference,
        gaps,
        had_a_fault,
    }
}

/// Everything is computed from the start, and is the same.
fn demand_identical(name: &str, drive: &Drive) {
    let replayed = recorded(drive);
    assert_eq!(replayed.first_difference, None, "{name}");
    assert_eq!(replayed.gaps, Vec::<String>::new(), "{name}");
    for tally in replayed.tallies {
        let is_whole = tally.compared == tally.answers && tally.answers > drive.cycles / 2;
        assert!(is_whole && tally.begun == 1, "{name}: {tally:?}");
        assert!(tally.states > 0, "{name}: {tally:?}");
    }
}

#[test]
fn a_drive_with_two_faults_is_computed_again_from_its_start() {
    demand_identical("rover", &ROVER);
    let replayed = recorded(&ROVER);
    assert_eq!(
        replayed.had_a_fault, [true; 4],
        "there was something to compute"
    );
}

#[test]
fn a_window_is_computed_from_the_first_state_that_was_handed_out() {
    let drive = Drive {
        unrecorded: 900,
        ..ROVER
    };
    let replayed = recorded(&drive);
    assert_eq!(replayed.first_difference, None);
    for tally in replayed.tallies {
        assert!(tally.compared > 1000 && tally.begun == 1, "{tally:?}");
        assert!(tally.compared < tally.answers, "{tally:?}");
        assert!(tally.states > 0, "a later state is compared: {tally:?}");
    }
}

#[test]
fn every_filter_of_the_identifier_goes_on_from_its_state() {
    use vigil_diagnosis::identify::IdentifierFilter as Filter;
    let changes: [(&str, Change); 7] = [
        ("bootstrap", |file| {
            file.identifier.filter = Filter::Bootstrap
        }),
        ("raised", |file| file.identifier.filter = Filter::Raised),
        ("adaptive", |file| file.identifier.filter = Filter::Adaptive),
        ("risk-sensitive", |file| {
            file.identifier.filter = Filter::RiskSensitive
        }),
        ("hierarchical", |file| {
            file.identifier.filter = Filter::Hierarchical
        }),
        ("look-ahead", |file| {
            file.identifier.filter = Filter::LookAhead
        }),
        ("imm", |file| file.identifier.filter = Filter::Imm),
    ];
    for (name, change) in changes {
        let drive = Drive {
            change,
            unrecorded: 900,
            ..ROVER
        };
        demand_same_from_a_state(name, &drive);
    }
}

#[test]
fn every_form_of_the_detector_and_other_graphs_go_on_from_their_state() {
    use vigil_diagnosis::detect::Form;
    let changes: [(&str, &'static str, Change); 5] = [
        ("constant", "rover.toml", |file| {
            file.detector.form = Form::Constant
        }),
        ("windowed", "rover.toml", |file| {
            file.detector.form = Form::Windowed
        }),
        ("e-detector", "rover.toml", |file| {
            file.detector.form = Form::EDetector
        }),
        ("all sensors", "rover-all.toml", UNCHANGED),
        ("a corridor", "corridor-people.toml", UNCHANGED),
    ];
    for (name, config, change) in changes {
        let drive = Drive {
            config,
            change,
            unrecorded: 900,
            ..ROVER
        };
        demand_same_from_a_state(name, &drive);
    }
}

#[test]
fn a_model_of_channels_goes_on_from_its_state() {
    let drive = Drive {
        config: "kobuki.toml",
        inject: &["stuck:L@30"],
        unrecorded: 900,
        ..ROVER
    };
    demand_same_from_a_state("kobuki", &drive);
}

#[test]
fn every_policy_of_the_supervisor_goes_on_from_its_state() {
    for (name, change) in POLICIES {
        let drive = Drive {
            change: *change,
            unrecorded: 900,
            ..ROVER
        };
        demand_same_from_a_state(name, &drive);
    }
}

/// Policies that need nothing solved beforehand.
const POLICIES: &[(&str, Change)] = &[
    ("qmdp", |file| set_policy(file, "qmdp")),
    ("dm-mls", |file| set_policy(file, "dm-mls")),
    ("adm-qmdp", |file| set_policy(file, "adm-qmdp")),
    ("despot", |file| set_policy(file, "despot")),
];

fn set_policy(file: &mut GraphFile, name: &str) {
    file.supervisor.policy = name.to_owned();
    file.supervisor.policy_file = None;
    file.supervisor.information_actions = vec!["slow_down".to_owned()];
}

fn demand_same_from_a_state(name: &str, drive: &Drive) {
    let replayed = recorded(drive);
    assert_eq!(replayed.first_difference, None, "{name}");
    assert_eq!(replayed.gaps, Vec::<String>::new(), "{name}");
    // Not every filter finds a name.
    let [alarm, _, action, _] = replayed.had_a_fault;
    assert!(alarm && action, "{name}: something to compute");
    for tally in replayed.tallies {
        let is_there = tally.compared > 1000 && tally.states > 0 && tally.begun == 1;
        assert!(is_there, "{name}: {tally:?}");
    }
}

#[test]
fn ten_minutes_with_five_faults_are_computed_again() {
    let drive = Drive {
        inject: &[
            "stuck:RM@30",
            "clear:RM@90",
            "encoder:LF:zero@150",
            "clear:LF@210",
            "stuck:LR@270",
            "clear:LR@330",
            "encoder:RF:noise@390",
            "clear:RF@450",
            "stuck:LM@510",
        ],
        cycles: 60_000,
        ..ROVER
    };
    demand_identical("ten minutes", &drive);
}

#[test]
fn restarts_a_new_publisher_and_blindness_are_computed_again() {
    let hiccup = |k| match k {
        // For longer than a second no frame comes: the detector is blind.
        700..=830 => Hiccup::Silent,
        1300 | 1900 => Hiccup::Renewed,
        1600 => Hiccup::Restarted,
        2000 => Hiccup::SupervisorRestarted,
        2300 => Hiccup::Ordered(ControlCommand::Acknowledge),
        2500 => Hiccup::Ordered(ControlCommand::Forget),
        _ => now_and_then(k),
    };
    let kobuki: &[&str] = &["stuck:L@30"];
    for (config, inject) in [("rover.toml", ROVER.inject), ("kobuki.toml", kobuki)] {
        let drive = Drive {
            config,
            inject,
            hiccup,
            ..ROVER
        };
        let replayed = recorded(&drive);
        assert_eq!(replayed.first_difference, None, "{config}");
        assert_eq!(replayed.gaps, Vec::<String>::new(), "{config}");
        let begun = replayed.tallies.map(|tally| tally.begun);
        assert_eq!(begun, [2, 1, 2], "{config}");
    }
}

#[test]
fn other_rates_are_computed_again() {
    let changes: [(&str, u64, Change); 2] = [
        ("10 Hz", 600, |file| file.graph.rate_hz = 10.0),
        ("400 Hz", 10_000, |file| file.graph.rate_hz = 400.0),
    ];
    for (name, cycles, change) in changes {
        let drive = Drive {
            change,
            cycles,
            ..ROVER
        };
        demand_identical(name, &drive);
    }
}

/// The recording of a short drive, with blocks changed, or dropped where `change` says so.
fn altered(mut change: impl FnMut(Topic, &mut Vec<u8>) -> bool) -> Replayed {
    let folder = tempfile::tempdir().unwrap();
    let [whole, other] = ["whole", "other"].map(|name| folder.path().join(name));
    let drive = Drive {
        cycles: 1500,
        ..ROVER
    };
    record(&drive, &whole);
    let mut reader = FlightReader::open(&whole).unwrap();
    let document = reader.document().unwrap().to_owned();
    let setup = Document::from_text(&whole, document.clone()).unwrap();
    let setup = setup.check().unwrap();
    let mut writer = FlightWriter::create(&other, &setup, WallClock::now()).unwrap();
    writer
        .attach("document.toml", "application/toml", document.as_bytes())
        .unwrap();
    while let Some(recorded) = reader.next().unwrap() {
        if let Recorded::Block { topic, bytes, .. } = recorded {
            let mut bytes = bytes.to_vec();
            if change(topic, &mut bytes) {
                writer.block(topic, &bytes).unwrap();
            }
        }
    }
    writer.finish().unwrap();
    replay(&other)
}

#[test]
fn a_bit_that_is_not_the_same_is_named() {
    let mut count = 0;
    let replayed = altered(|topic, bytes| {
        if topic == Topic::Diagnosis {
            count += 1;
            if count == 700 {
                let p = std::mem::offset_of!(FaultBelief, p) + 8;
                bytes[p] ^= 1;
            }
        }
        true
    });
    let (service, difference) = replayed.first_difference.unwrap();
    let named = (service, difference.field.as_str());
    assert_eq!(named, (ServiceName::Identifier, "p[1]"));
    assert_ne!(difference.recorded, difference.computed);
    assert_eq!(replayed.tallies.map(|tally| tally.different), [0, 1, 0]);
}

#[test]
fn a_fault_that_is_not_the_same_is_named() {
    let mut is_changed = false;
    let replayed = altered(|topic, bytes| {
        let at = std::mem::offset_of!(Faults, records) + std::mem::offset_of!(FaultRecord, p);
        if topic == Topic::Faults && !is_changed && bytes[at + 7] != 0 {
            bytes[at] ^= 1;
            is_changed = true;
        }
        true
    });
    let (service, difference) = replayed.first_difference.unwrap();
    let named = (service, difference.field.as_str());
    assert_eq!(named, (ServiceName::Supervisor, "records[0].p"));
    assert_eq!(replayed.tallies.map(|tally| tally.different), [0, 0, 1]);
}

#[test]
fn what_was_not_recorded_is_named_and_the_services_go_on_from_their_next_state() {
    let mut count = 0;
    let replayed = altered(|topic, _| {
        count += u32::from(topic == Topic::Sensor);
        topic != Topic::Sensor || count != 300
    });
    assert_eq!(replayed.first_difference, None);
    let gaps = [
        "detector: a sensor frame was not recorded",
        "identifier: the detector's hypotheses are not known",
        // It may be what is measured when a fault begins.
        "supervisor: a sensor frame was not recorded",
    ];
    assert_eq!(replayed.gaps, gaps);
    for tally in replayed.tallies {
        assert!(
            tally.begun == 2 && tally.compared < tally.answers,
            "{tally:?}"
        );
    }
}

#[test]
fn a_journal_with_a_block_too_few_is_a_gap() {
    let mut count = 0;
    let detector = Topic::Journal(ServiceName::Detector);
    let replayed = altered(|topic, _| {
        count += u32::from(topic == detector);
        topic != detector || count != 300
    });
    assert_eq!(replayed.first_difference, None);
    assert_eq!(replayed.gaps[0], "detector: the journal was not recorded");
}
