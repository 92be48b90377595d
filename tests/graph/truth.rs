//! What the simulator says is true, beside what it measures.

use std::collections::BTreeMap;

use vigil_blocks::{RecoveryKind, SensorFrame, Truth};
use vigil_cycle::{Graph, Receiver, Topic};

use crate::harness::{RunningGraph, drain, eventually, shared_machine};

/// A pose is measured within so much, m and rad: many standard deviations of its noise.
const NEAR: f64 = 0.1;

/// Frames and truths, as they come.
struct Watch {
    frames: Box<dyn Receiver<SensorFrame>>,
    truths: Box<dyn Receiver<Truth>>,
    /// By (epoch, seq).
    measured: BTreeMap<(u64, u64), SensorFrame>,
    told: Vec<Truth>,
}

impl Watch {
    fn new(graph: &Graph) -> Self {
        Self {
            frames: graph.receiver(Topic::Sensor).unwrap(),
            truths: graph.receiver(Topic::Truth).unwrap(),
            measured: BTreeMap::new(),
            told: Vec::new(),
        }
    }

    /// Takes what waits; the newest truth.
    fn poll(&mut self) -> Option<Truth> {
        drain(self.truths.as_mut(), |truth| self.told.push(*truth));
        drain(self.frames.as_mut(), |frame| {
            let id = frame.header.id();
            self.measured.insert((id.epoch, id.seq), *frame);
        });
        self.told.last().copied()
    }
}

#[test]
fn the_truth_of_each_frame_is_told_beside_it() {
    let _machine = shared_machine();
    let mut graph = RunningGraph::start("truth", &["--inject", "stuck:RM@1"]);
    let mut watch = Watch::new(&graph.observe());
    eventually("the wheel sticks", || {
        watch.poll().filter(|truth| truth.is_disturbed == 1)
    });
    eventually(
        "the rover no longer goes on as if nothing were wrong",
        || {
            watch
                .poll()
                .filter(|truth| truth.obeyed != RecoveryKind::GoOn as u32)
        },
    );
    graph.interrupt();
    let summary = graph.finish();
    let pairs: Vec<(&Truth, &SensorFrame)> = watch
        .told
        .iter()
        .filter_map(|truth| {
            let id = truth.cause.frame();
            Some((truth, watch.measured.get(&(id.epoch, id.seq))?))
        })
        .collect();
    // The reader may have joined between the two.
    assert!(pairs.len() > 90 && pairs.len() + 2 > watch.told.len());
    for (truth, frame) in &pairs {
        assert_eq!(truth.header.t_capture_ns, frame.header.t_capture_ns);
        assert_eq!(truth.run_id, frame.run_id);
        for (measured, is) in frame.channel.iter().zip(truth.pose) {
            assert!((measured - is).abs() < NEAR, "{measured} {is}");
        }
        assert_eq!((truth.touches, truth.at_goal), (0, 0));
    }
    // It obeys, then a wheel sticks and stays stuck, then the supervisor answers.
    let is = |truth: &Truth| (truth.is_disturbed, truth.obeyed);
    let mut phases: Vec<(u32, u32)> = watch.told.iter().map(is).collect();
    phases.dedup();
    let go_on = RecoveryKind::GoOn as u32;
    let at = phases.iter().position(|phase| *phase == (0, go_on));
    let [_, sticks, answered, ..] = phases[at.unwrap()..] else {
        panic!("{phases:?}");
    };
    assert_eq!(sticks, (1, go_on), "{phases:?}");
    assert_eq!(answered.0, 1, "{phases:?}");
    let kinds = [RecoveryKind::SlowDown, RecoveryKind::Compensate].map(|it| it as u32);
    assert!(kinds.contains(&answered.1), "{phases:?}");
    assert_eq!(summary.events("injected").len(), 1);
}

#[test]
fn the_truth_says_when_a_corridor_is_driven_to_its_end() {
    let _machine = shared_machine();
    let config = "config/corridor-people.toml".into();
    let mut graph = RunningGraph::start_with(config, "truth-goal", &[]);
    let mut watch = Watch::new(&graph.observe());
    let truth = eventually("the rover is at its goal", || {
        watch.poll().filter(|truth| truth.at_goal == 1)
    });
    graph.interrupt();
    assert_eq!(graph.finish().events("goal").len(), 1);
    // The goal of that file is at 7 m.
    let off_m = (truth.pose[0] - 7.0).hypot(truth.pose[1]);
    assert!(off_m < 0.5, "{:?}", truth.pose);
    assert!(watch.told.iter().all(|it| it.is_disturbed == 0));
    assert!(watch.told.iter().all(|it| it.touches == 0));
}
