//! The live graph's beliefs, rebuilt offline from its journal: bit for bit the same.

use std::collections::BTreeMap;

use vigil_blocks::{
    Block, CauseKind, DetectionBelief, Entry, FaultBelief, Header, ParticleBlock, SensorFrame,
};
use vigil_cycle::Topic;
use vigil_diagnosis::identify::IdentifierFilter;
use vigil_diagnosis::identify::Input;

use crate::harness::{RunningGraph, drain, machine};

/// Everything that the graph published, by identity of the sensor frame.
#[derive(Default)]
struct RecordedBlocks {
    frames: BTreeMap<u64, SensorFrame>,
    detections: BTreeMap<u64, DetectionBelief>,
    diagnoses: BTreeMap<u64, FaultBelief>,
    first_detection_seq: Option<u64>,
    missed: usize,
}

fn record(graph: &mut RunningGraph) -> RecordedBlocks {
    let observed = graph.observe();
    let mut sensor = observed.receiver::<SensorFrame>(Topic::Sensor).unwrap();
    let mut detection = observed
        .receiver::<DetectionBelief>(Topic::Detection)
        .unwrap();
    let mut diagnosis = observed.receiver::<FaultBelief>(Topic::Diagnosis).unwrap();
    let mut recorded = RecordedBlocks::default();
    while graph.is_alive() {
        drain(sensor.as_mut(), |frame| {
            recorded.frames.insert(frame.header.seq, *frame);
        });
        drain(detection.as_mut(), |block| {
            recorded.first_detection_seq.get_or_insert(block.header.seq);
            if block.cause.kind() == Some(CauseKind::Frame) {
                recorded.detections.insert(block.cause.frame_seq, *block);
            } else {
                recorded.missed += 1;
            }
        });
        drain(diagnosis.as_mut(), |block| {
            if block.cause.kind() == Some(CauseKind::Frame) {
                recorded.diagnoses.insert(block.cause.frame_seq, *block);
            }
        });
        std::thread::sleep(std::time::Duration::from_millis(2));
    }
    recorded
}

#[test]
fn beliefs_live_and_offline_are_bit_identical() {
    compare(IdentifierFilter::MultipleHypothesis);
}

#[test]
fn beliefs_of_a_sampled_filter_are_bit_identical_too() {
    compare(IdentifierFilter::Hierarchical);
}

fn compare(filter: IdentifierFilter) {
    let _machine = machine();
    let name = filter.to_string();
    let options = [
        "--duration",
        "8",
        "--inject",
        "stuck:LM@3",
        "--identifier",
        &name,
    ];
    let mut graph = RunningGraph::start("identity", &options);
    let recorded = record(&mut graph);
    let mut setup = graph.setup.clone();
    setup.file.identifier.filter = filter;
    graph.finish();
    assert_eq!(
        recorded.first_detection_seq,
        Some(0),
        "the observer was there from the start"
    );
    let last = *recorded.frames.keys().last().unwrap();
    assert_eq!(
        recorded.frames.len() as u64,
        last + 1,
        "every frame was recorded"
    );

    let mut detector = vigil_detector::assemble(&setup).unwrap();
    let mut identifier = vigil_identifier::assemble(&setup).unwrap();
    let mut compared = 0;
    for (seq, frame) in &recorded.frames {
        let (mut belief, mut particles) = (DetectionBelief::default(), zeroed_particles());
        detector.step(Entry::Frame(frame), &mut belief, &mut particles);
        let live = recorded.detections.get(seq);
        if let Some(live) = live {
            let offline = DetectionBelief {
                header: live.header,
                cause: live.cause,
                ..belief
            };
            assert_same(&offline, live, *seq);
        }
        // A frame whose detection was folded into a later one had none live either.
        let detection = live.map(|_| (&belief, &*particles));
        let (mut diagnosis, mut drawn) = (FaultBelief::default(), zeroed_particles());
        let input = Input { frame, detection };
        identifier.step(Entry::Frame(input), &mut diagnosis, &mut drawn);
        if let Some(live) = recorded.diagnoses.get(seq) {
            let header: Header = live.header;
            let offline = FaultBelief {
                header,
                cause: live.cause,
                ..diagnosis
            };
            assert_same(&offline, live, *seq);
            compared += 1;
        }
    }
    assert!(
        compared > 600,
        "{compared} beliefs compared, {} predictions",
        recorded.missed
    );
    let named = recorded.diagnoses.values().last().unwrap().mode;
    assert_eq!(setup.tree.nodes()[named as usize].name, "LM_STUCK");
}

fn assert_same<T: Block>(offline: &T, live: &T, seq: u64) {
    let (offline, live) = (bytemuck::bytes_of(offline), bytemuck::bytes_of(live));
    assert_eq!(offline, live, "frame {seq}");
}

fn zeroed_particles() -> Box<ParticleBlock> {
    bytemuck::allocation::zeroed_box()
}
