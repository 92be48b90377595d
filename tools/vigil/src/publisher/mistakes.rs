//! Mistakes that users make in headers, bits and transport, and what is said of each.

use std::path::PathBuf;

use vigil_blocks::{Block, SensorFrame};
use vigil_robot::ChannelMap;
use vigil_setup::graph_file::{GraphFile, Source};
use vigil_setup::{Border, load_graph};

use super::listen::Guard;
use super::{FrameArrival, Reception};
use crate::findings::{Finding, Status};

const MS: u64 = 1_000_000;
const PERIOD_NS: u64 = 50 * MS;
/// Places of channels: the pose, and the first wheel's rate.
const X: usize = 0;
const ENC_LF: usize = 3;

/// A graph of the rover at 20 Hz.
fn border() -> Border {
    let root = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../..");
    let external = |file: &mut GraphFile| {
        file.sensor.source = Source::External;
        file.graph.rate_hz = 20.0;
    };
    load_graph(&root.join("config/rover.toml"), external)
        .unwrap()
        .border()
}

/// A recorded run without a fault, as a good publisher sends it: each frame when it is due.
fn sent(border: &Border) -> Vec<FrameArrival> {
    let root = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../..");
    let path = root.join("tests/data/rover/learn_frames.csv.gz");
    let runs = vigil_recording::frames::read(&path, &border.robot).unwrap();
    let hash = ChannelMap::new(&border.robot).hash();
    let arrived = |(k, frame): (usize, &SensorFrame)| {
        let (mut frame, now_ns) = (*frame, 3_600_000 * MS + k as u64 * PERIOD_NS);
        let header = &mut frame.header;
        (header.schema, header.epoch, header.seq) = (SensorFrame::SCHEMA, 7, k as u64);
        (header.t_schedule_ns, header.t_capture_ns) = (now_ns, now_ns);
        (frame.robot_hash, frame.run_id) = (hash, 1);
        FrameArrival { now_ns, frame }
    };
    runs[1].frames.iter().enumerate().map(arrived).collect()
}

/// What is said of frames as a reader in the graph's place hears them.
fn said(border: &Border, frames: Vec<FrameArrival>, unannounced: bool) -> Vec<Finding> {
    let mut guard = Guard::new(border);
    for FrameArrival { frame, now_ns } in &frames {
        guard.take(frame, *now_ns);
    }
    let heard = Reception {
        unannounced: if unannounced { frames.len() as u64 } else { 0 },
        seconds: frames.len() as f64 * 0.05,
        rejected: guard.rejected(),
        frames,
        ..Reception::default()
    };
    super::findings(border, &heard)
}

/// A mistake in a frame by its place.
type Mistake = fn(u64, &mut FrameArrival);

/// The mistake, how a finding of it begins, and what it says.
struct Case {
    what: &'static str,
    mistake: Mistake,
    check: &'static str,
    detail: &'static str,
}

/// Times as they are where the recording begins, ns.
fn since(t_ns: u64) -> u64 {
    t_ns - 3_600_000 * MS
}

#[rustfmt::skip]
const CASES: &[Case] = &[
    Case { what: "all times in us", check: "refused: behind", detail: "in ns",
        mistake: |_, f| {
            f.frame.header.t_schedule_ns /= 1000;
            f.frame.header.t_capture_ns /= 1000;
        } },
    Case { what: "capture in us", check: "capture clock", detail: "it is in us, ns are wanted",
        mistake: |_, f| f.frame.header.t_capture_ns /= 1000 },
    Case { what: "capture in ms", check: "capture clock", detail: "it is in ms, ns are wanted",
        mistake: |_, f| f.frame.header.t_capture_ns /= MS },
    Case { what: "capture 0", check: "capture clock", detail: "never changes",
        mistake: |_, f| f.frame.header.t_capture_ns = 0 },
    Case { what: "schedule constant", check: "refused: early",
        detail: "header.t_schedule_ns advance",
        mistake: |_, f| f.frame.header.t_schedule_ns = 3_600_000 * MS },
    Case { what: "wall clock in schedule", check: "refused: ahead", detail: "not the time of day",
        mistake: |_, f| f.frame.header.t_schedule_ns += 1_700_000_000_000 * MS },
    Case { what: "NaN", check: "enc_LF", detail: "NaN or infinite in 30 of 300",
        mistake: |k, f| if k % 10 == 0 { f.frame.channel[ENC_LF] = f64::NAN } },
    Case { what: "no bits", check: "yaw", detail: "never marked as valid",
        mistake: |_, f| f.frame.channel_valid = 0 },
    Case { what: "a run for each frame", check: "starts", detail: "run_id once when a drive does",
        mistake: |k, f| f.frame.run_id = k },
    Case { what: "no epoch", check: "refused: no-epoch", detail: "header.epoch is 0",
        mistake: |_, f| f.frame.header.epoch = 0 },
    Case { what: "an epoch for each frame", check: "starts", detail: "header.epoch once",
        mistake: |k, f| f.frame.header.epoch = k + 1 },
    Case { what: "seq constant", check: "refused: repeated", detail: "header.seq repeats",
        mistake: |_, f| f.frame.header.seq = 5 },
    Case { what: "seq back", check: "refused: wrong-sequence", detail: "header.seq goes back",
        mistake: |k, f| f.frame.header.seq = 10_000 - k },
    Case { what: "seq random", check: "refused: wrong-sequence", detail: "count it up by one",
        mistake: |k, f| f.frame.header.seq = k.wrapping_mul(0x9e37_79b9_7f4a_7c15) >> 2 },
    Case { what: "another schema", check: "refused: schema", detail: "generated types",
        mistake: |_, f| f.frame.header.schema ^= 1 },
    Case { what: "another robot's channels", check: "refused: robot",
        detail: "another channel list",
        mistake: |_, f| f.frame.robot_hash ^= 1 },
    Case { what: "no command", check: "cmd_curv", detail: "never marked as valid",
        mistake: |_, f| f.frame.command_valid = 0 },
    Case { what: "no encoders", check: "enc_LF", detail: "never marked as valid",
        mistake: |_, f| f.frame.channel_valid &= !(0x3f << ENC_LF) },
    Case { what: "encoders one further", check: "enc_LF", detail: "never marked as valid",
        mistake: |_, f| {
            f.frame.channel[ENC_LF..ENC_LF + 7].rotate_right(1);
            f.frame.channel_valid &= !(1 << ENC_LF);
        } },
    Case { what: "everything frozen", check: "enc_LF", detail: "never changes",
        mistake: |_, f| f.frame.channel = std::array::from_fn(|i| if i < 9 { 1.5 } else { 0.1 }) },
    Case { what: "bursts of ten", check: "bursts", detail: "10 at once",
        mistake: |k, f| f.now_ns += PERIOD_NS * (9 - k % 10) },
    Case { what: "five times as fast", check: "rate", detail: "100.00 Hz; graph.rate_hz is 20",
        mistake: |_, f| quicken(f, 5) },
    Case { what: "twice as fast", check: "rate", detail: "40.00 Hz; graph.rate_hz is 20",
        mistake: |_, f| quicken(f, 2) },
    Case { what: "a jump of 3 m", check: "pose", detail: "count pose_reset_count up",
        mistake: |k, f| if k > 150 { f.frame.channel[X] += 3.0 } },
    Case { what: "a jump of 300 m", check: "refused: jump", detail: "count pose_reset_count up",
        mistake: |k, f| if k > 150 { f.frame.channel[X] += 300.0 } },
    Case { what: "command in cm/s", check: "cmd_speed", detail: "Is the unit right?",
        mistake: |_, f| f.frame.command[1] *= 100.0 },
    Case { what: "command's axes exchanged", check: "meaning",
        detail: "cmd_curv and cmd_speed are exchanged",
        mistake: |_, f| f.frame.command.swap(0, 1) },
    Case { what: "command reversed", check: "meaning", detail: "cmd_curv has the other sign",
        mistake: |_, f| f.frame.command[0] = -f.frame.command[0] },
];

/// Frames that come so many times as fast.
fn quicken(arrived: &mut FrameArrival, times: u64) {
    let at_ns = 3_600_000 * MS + since(arrived.now_ns) / times;
    let header = &mut arrived.frame.header;
    (arrived.now_ns, header.t_schedule_ns, header.t_capture_ns) = (at_ns, at_ns, at_ns);
}

#[test]
fn each_mistake_is_told_under_its_name() {
    let border = border();
    let good = sent(&border);
    let mut wrong = Vec::new();
    for case in CASES {
        let mut frames = good.clone();
        let all = frames.iter_mut().enumerate();
        all.for_each(|(k, arrived)| (case.mistake)(k as u64, arrived));
        let told = said(&border, frames, false);
        let is_it = |f: &Finding| f.check == case.check && f.detail.contains(case.detail);
        if !told.iter().any(|f| f.status > Status::Unjudged && is_it(f)) {
            let mut bad = told;
            bad.retain(|f| f.status > Status::Unjudged);
            wrong.push(format!("{}: {bad:#?}", case.what));
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

#[test]
fn what_is_no_mistake_is_not_told() {
    let border = border();
    let harmless: [(&str, Mistake); 4] = [
        ("wall clock in capture", |_, f| {
            f.frame.header.t_capture_ns += 1_700_000_000_000 * MS
        }),
        ("seq from 1", |_, f| f.frame.header.seq += 1),
        ("run 0", |_, f| f.frame.run_id = 0),
        ("yaw unwrapped", |_, f| {
            f.frame.channel[2] += std::f64::consts::TAU
        }),
    ];
    for (what, change) in harmless {
        let mut frames = sent(&border);
        let all = frames.iter_mut().enumerate();
        all.for_each(|(k, arrived)| change(k as u64, arrived));
        let mut bad = said(&border, frames, false);
        // The topic is the transport's.
        bad.retain(|f| f.status > Status::Unjudged && f.check != "type");
        assert!(bad.is_empty(), "{what}: {bad:?}");
    }
}

#[test]
fn lost_frames_and_missing_notifications_are_told_as_such() {
    let border = border();
    let of = |told: &[Finding], check: &str| -> (Status, String) {
        let one = told.iter().find(|f| f.check == check);
        one.map(|f| (f.status, f.detail.clone())).unwrap()
    };
    let mut lossy = sent(&border);
    let mut k = 0;
    lossy.retain(|_| {
        k += 1;
        k % 10 != 0
    });
    let told = said(&border, lossy, false);
    assert_eq!(of(&told, "gaps").0, Status::Warning);
    assert_eq!(of(&told, "rate").0, Status::Ok, "{:?}", of(&told, "rate"));
    let told = said(&border, sent(&border), true);
    let (status, detail) = of(&told, "notification");
    assert_eq!(status, Status::Failure);
    assert!(
        detail.starts_with("frames arrive but no notification: 300 of 300"),
        "{detail}"
    );
}
