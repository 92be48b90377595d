//! The identifier on recorded runs that its model has not seen, and on garbage.

use clap::ValueEnum;
use vigil_blocks::{Entry, FaultBelief, MODE_MULTIPLE, MODE_UNKNOWN, ParticleBlock, SensorFrame};
use vigil_diagnosis::Sensors;
use vigil_diagnosis::identify::{
    self, Identifier, IdentifierError, IdentifierFilter, Input, Models,
};
use vigil_robot::FaultTree;
use vigil_robot::tree::Node;

use super::alarm::Alarm;
use crate::recorded::{model, path, robot, unseen};

fn time_s(frame: &SensorFrame) -> f64 {
    frame.header.t_capture_ns as f64 * 1e-9
}

fn tree() -> FaultTree {
    vigil_setup::load_tree(&path("config/trees/rover.toml")).unwrap()
}

struct Bench {
    identifier: Identifier,
    tree: FaultTree,
    alarm: Alarm,
    belief: FaultBelief,
    hypotheses: Box<ParticleBlock>,
}

impl Bench {
    fn new(sensors: Sensors, alarm: Alarm) -> Self {
        Self::with(IdentifierFilter::MultipleHypothesis, sensors, alarm)
    }

    fn with(filter: IdentifierFilter, sensors: Sensors, alarm: Alarm) -> Self {
        Self::over(tree(), filter, sensors, alarm)
    }

    fn over(tree: FaultTree, filter: IdentifierFilter, sensors: Sensors, alarm: Alarm) -> Self {
        let settings = identify::Settings {
            filter,
            ..identify::Settings::default()
        };
        let decision = vigil_setup::load_decision(&path("config/rover.pomdp")).unwrap();
        let risks = vigil_setup::state_risks(&decision).unwrap();
        let models = Models {
            model: &model(),
            robot: &robot(),
            tree: &tree,
            risks: Some(&risks),
        };
        let identifier = Identifier::new(&models, &settings, sensors, 1).unwrap();
        let belief = FaultBelief::default();
        Self {
            identifier,
            tree,
            alarm,
            belief,
            hypotheses: Box::default(),
        }
    }

    fn step(&mut self, frame: &SensorFrame) -> &FaultBelief {
        self.alarm.set(frame);
        let detection = Some((&self.alarm.belief, &*self.alarm.hypotheses));
        let entry = Entry::Frame(Input { frame, detection });
        self.identifier
            .step(entry, &mut self.belief, &mut self.hypotheses);
        self.check();
        &self.belief
    }

    /// What must hold of every belief.
    fn check(&self) {
        let b = &self.belief;
        for (p, unknown) in [(b.p, b.p_unknown), (b.p_predicted, b.p_unknown_predicted)] {
            assert!((0.0..=1.0).contains(&unknown));
            assert!(p.iter().all(|p| (0.0..=1.0 + 1e-12).contains(p)), "{p:?}");
            for (parent, node) in self.tree.nodes().iter().enumerate().skip(1) {
                let children = || {
                    let nodes = self.tree.nodes().iter().enumerate();
                    nodes
                        .filter(|(_, n)| n.parent == Some(parent))
                        .map(|(i, _)| p[i])
                };
                // Any of several faults: no less than one of them, no more than their sum.
                if node.fault.is_none() {
                    let highest = children().fold(0.0, f64::max);
                    let sum: f64 = children().sum();
                    assert!(highest - 1e-9 <= p[parent] && p[parent] <= sum + 1e-9);
                }
            }
        }
        // One fault may be there with others: the leaves' sum may exceed what is left.
        let leaves: f64 = self.tree.leaves().map(|leaf| b.p[leaf]).sum();
        assert!(b.p[0] + leaves + b.p_unknown > 1.0 - 1e-9, "{b:?}");
        assert!(b.channel_evidence.iter().all(|value| value.is_finite()));
        assert!(b.entropy.is_finite() && b.entropy >= 0.0 && (0.0..=1.0).contains(&b.p_mode));
        assert!(b.sets[..b.set_count as usize].is_sorted_by(|x, y| x.p >= y.p));
        let used = self.hypotheses.used();
        assert!(used.is_sorted_by(|x, y| x.log_weight >= y.log_weight));
        for hypothesis in used {
            assert!(hypothesis.pose.iter().all(|value| value.is_finite()));
            assert!(hypothesis.log_weight.is_finite());
        }
    }

    fn mode(&self) -> &str {
        match self.belief.mode {
            MODE_UNKNOWN => "UNKNOWN",
            MODE_MULTIPLE => "MULTIPLE",
            node => &self.tree.nodes()[node as usize].name,
        }
    }
}

#[test]
fn each_fault_is_named_soon_after_the_alarm_and_to_the_end() {
    let cases = [
        ("RM_STUCK", "stuck", Sensors::PoseEncoders),
        ("LF_STUCK", "stuck", Sensors::PoseEncoders),
        ("LR_STUCK", "stuck", Sensors::Pose),
        ("RF_ENC", "zero", Sensors::PoseEncoders),
        ("LM_ENC", "frozen", Sensors::PoseEncoders),
        ("RR_ENC", "noise", Sensors::PoseEncoders),
    ];
    for (mode, kind, sensors) in cases {
        let (frames, label) = unseen(mode, kind);
        let onset_s = label.onset_s.unwrap();
        let mut bench = Bench::new(sensors, Alarm::between(onset_s + 0.6, 99.0));
        for frame in &frames {
            bench.step(frame);
            let t_s = time_s(frame);
            if t_s < onset_s + 0.6 {
                assert_eq!((bench.mode(), bench.belief.identifying), ("ND", 0));
            } else if t_s > onset_s + 2.0 {
                assert_eq!(bench.mode(), mode, "at {t_s} s, {kind}");
            }
        }
        // Evidence from before the alarm counts: the onset lies in the ring.
        let found_s = bench.belief.onset_t_capture_ns as f64 * 1e-9;
        assert!(
            (found_s - onset_s).abs() < 0.45,
            "{mode}: {found_s} s, not {onset_s} s"
        );
        let node = bench.tree.index(mode).unwrap();
        assert_eq!(bench.belief.sets[0].leaves, 1 << node);
        assert_eq!(bench.hypotheses.used()[0].leaves, 1 << node);
        let used = bench.hypotheses.used().iter();
        let named = used.filter(|hypothesis| hypothesis.leaves >> node & 1 == 1);
        let p: f64 = named.map(|hypothesis| hypothesis.log_weight.exp()).sum();
        assert!((p - bench.belief.p[node]).abs() < 1e-9, "{p}");
    }
}

#[test]
fn a_fault_that_goes_is_let_go() {
    let (mut frames, _) = unseen("ND", "");
    for frame in frames
        .iter_mut()
        .filter(|frame| (4.0..6.0).contains(&time_s(frame)))
    {
        frame.channel[3 + 2] = 0.0;
    }
    let mut bench = Bench::new(Sensors::PoseEncoders, Alarm::between(4.1, 7.5));
    for frame in &frames {
        bench.step(frame);
        let t_s = time_s(frame);
        if (4.3..6.0).contains(&t_s) {
            assert_eq!(bench.mode(), "LR_ENC", "at {t_s} s");
        } else if t_s > 7.0 {
            assert_eq!(bench.mode(), "ND", "at {t_s} s");
        }
    }
    assert_eq!(
        (bench.belief.mode_change_count, bench.belief.identifying),
        (2, 0)
    );
}

#[test]
fn no_fault_fades_while_the_robot_stands() {
    let (mut frames, label) = unseen("RM_STUCK", "stuck");
    let onset_s = label.onset_s.unwrap();
    let mut rest = None;
    for frame in frames
        .iter_mut()
        .filter(|frame| time_s(frame) > onset_s + 2.0)
    {
        frame.command[1] = 0.0;
        frame.channel[3..9].fill(0.0);
        let pose: [f64; 3] = [frame.channel[0], frame.channel[1], frame.channel[2]];
        frame.channel[..3].copy_from_slice(rest.get_or_insert(pose));
    }
    let alarm = Alarm::between(onset_s + 0.2, 99.0);
    let mut bench = Bench::new(Sensors::PoseEncoders, alarm);
    let mut before: Option<FaultBelief> = None;
    for frame in &frames {
        let belief = *bench.step(frame);
        if time_s(frame) > onset_s + 2.1 {
            let before = before.get_or_insert(belief);
            assert_eq!((before.p, before.p_unknown), (belief.p, belief.p_unknown));
            assert_eq!(belief.p, belief.p_predicted);
        }
    }
    assert_eq!(bench.mode(), "RM_STUCK");
}

#[test]
fn a_motion_that_no_fault_explains_is_unknown() {
    // The robot is pushed sideways while every wheel turns as it should.
    let (mut frames, _) = unseen("ND", "");
    for frame in frames.iter_mut().filter(|frame| time_s(frame) >= 5.0) {
        let t_s = time_s(frame) - 5.0;
        frame.channel[0] += 0.03 * t_s;
        frame.channel[1] += 0.03 * t_s;
    }
    let mut bench = Bench::new(Sensors::PoseEncoders, Alarm::between(5.5, 99.0));
    for frame in &frames {
        bench.step(frame);
        if time_s(frame) > 7.0 {
            assert_eq!(bench.mode(), "UNKNOWN");
        }
    }
}

#[test]
fn a_steering_angle_that_nobody_commanded_is_unknown() {
    let (mut frames, _) = unseen("ND", "");
    for frame in frames.iter_mut().filter(|frame| time_s(frame) >= 5.0) {
        frame.channel[9] += 0.2;
    }
    let mut bench = Bench::new(Sensors::PoseEncoders, Alarm::between(5.1, 99.0));
    for frame in &frames {
        bench.step(frame);
    }
    assert_eq!(bench.mode(), "UNKNOWN");
}

#[test]
fn between_observations_no_evidence_counts_twice() {
    let (frames, label) = unseen("LF_STUCK", "stuck");
    let alarm = Alarm::between(label.onset_s.unwrap() + 0.2, 99.0);
    let mut bench = Bench::new(Sensors::PoseEncoders, alarm);
    for frame in &frames {
        let told = *bench.step(frame);
        bench
            .identifier
            .step(Entry::Missed(3), &mut bench.belief, &mut bench.hypotheses);
        bench.check();
        let belief = &bench.belief;
        assert_eq!((belief.p, belief.p_unknown), (told.p, told.p_unknown));
        assert_eq!(
            (belief.p_predicted, belief.p_unknown_predicted),
            (told.p, told.p_unknown)
        );
    }
}

#[test]
fn equal_input_and_seed_give_equal_bits_whatever_came_before() {
    let (frames, label) = unseen("RM_STUCK", "stuck");
    let (others, _) = unseen("LF_STUCK", "stuck");
    let onset_s = label.onset_s.unwrap();
    for &filter in IdentifierFilter::value_variants() {
        let alarm = || Alarm::between(onset_s + 0.5, 99.0);
        let fresh = || Bench::with(filter, Sensors::Pose, alarm());
        let (mut a, mut b) = (fresh(), fresh());
        for frame in &others {
            b.step(frame);
        }
        for frame in &frames {
            a.step(frame);
            b.step(frame);
            let (a_told, mut b_told) = (a.belief, b.belief);
            b_told.mode_change_count = a_told.mode_change_count;
            b_told.reported_change_count = a_told.reported_change_count;
            assert_eq!(a_told, b_told, "{filter}");
            assert!(a.hypotheses.used() == b.hypotheses.used(), "{filter}");
        }
    }
}

#[test]
fn every_filter_names_single_faults() {
    // The classical filter has a fault only if one of its particles arrives there by chance, and is
    // shown in `bench` to be often wrong.
    let all = IdentifierFilter::value_variants().iter().copied();
    for filter in all.filter(|filter| *filter != IdentifierFilter::Bootstrap) {
        for (mode, kind) in [
            ("RM_STUCK", "stuck"),
            ("RF_ENC", "zero"),
            ("RR_ENC", "noise"),
        ] {
            let (frames, label) = unseen(mode, kind);
            let onset_s = label.onset_s.unwrap();
            let alarm = Alarm::between(onset_s + 0.1, 99.0);
            let mut bench = Bench::with(filter, Sensors::PoseEncoders, alarm);
            let mut wrong_s = 0.0;
            for pair in frames.windows(2) {
                bench.step(&pair[1]);
                let t_s = time_s(&pair[1]);
                if t_s > onset_s + 2.0 && bench.mode() != mode {
                    wrong_s += t_s - time_s(&pair[0]);
                }
            }
            assert!(wrong_s < 1.0, "{filter}, {mode}: wrong for {wrong_s} s");
            let found_s = bench.belief.onset_t_capture_ns as f64 * 1e-9;
            assert!(
                (found_s - onset_s).abs() < 1.0,
                "{filter}, {mode}: {found_s} s"
            );
            for hypothesis in bench.hypotheses.used() {
                let (is_fault, onset) = (hypothesis.mode != 0, hypothesis.onset_t_capture_ns);
                assert_eq!(onset != 0, is_fault, "{filter}, {mode}: {onset} ns");
            }
        }
    }
}

/// The shipped tree below two more levels.
fn deep_tree() -> FaultTree {
    let node = |name: &str, parent| Node {
        name: name.into(),
        parent,
        fault: None,
    };
    let mut nodes = vec![node("ND", None), node("ANY", None), node("STUCK", Some(1))];
    for shipped in tree().nodes().iter().skip(1) {
        let parent = match (shipped.name.as_str(), shipped.parent) {
            ("LSS" | "RSS", _) => Some(2),
            (_, None) => Some(1),
            (_, Some(parent)) => Some(parent + 2),
        };
        nodes.push(Node {
            parent,
            ..shipped.clone()
        });
    }
    FaultTree::new(nodes).unwrap()
}

#[test]
fn a_tree_may_have_any_depth() {
    use vigil_diagnosis::identify::IdentifierFilter::{Hierarchical, MultipleHypothesis};
    let (frames, label) = unseen("LM_STUCK", "stuck");
    for filter in [MultipleHypothesis, Hierarchical] {
        let alarm = Alarm::between(label.onset_s.unwrap() + 0.1, 99.0);
        let sensors = Sensors::PoseEncoders;
        let mut bench = Bench::over(deep_tree(), filter, sensors, alarm);
        for frame in &frames {
            bench.step(frame);
        }
        assert_eq!(bench.mode(), "LM_STUCK", "{filter}");
        let p = |name: &str| bench.belief.p[bench.tree.index(name).unwrap()];
        assert!(p("ANY") >= p("STUCK") && p("STUCK") >= p("LSS") && p("LSS") > 0.9);
        assert!((p("ANY") + p("ND") + bench.belief.p_unknown - 1.0).abs() < 1e-9);
    }
}

#[test]
fn trees_that_the_model_cannot_serve_are_refused() {
    let node = |name: &str, fault: Option<&str>| Node {
        name: name.into(),
        parent: None,
        fault: fault.map(Into::into),
    };
    let build = |faults: &[&str]| {
        let leaves = faults
            .iter()
            .enumerate()
            .map(|(i, f)| node(&format!("L{i}"), Some(f)));
        let nodes = std::iter::once(node("ND", None)).chain(leaves).collect();
        let tree = FaultTree::new(nodes).unwrap();
        let settings = identify::Settings::default();
        let sensors = Sensors::Pose;
        let models = Models {
            model: &model(),
            robot: &robot(),
            tree: &tree,
            risks: None,
        };
        Identifier::new(&models, &settings, sensors, 1).map(|_| ())
    };
    assert!(build(&["stuck:RM", "encoder:RM"]).is_ok());
    for bad in ["stuck:XX", "arm:RM", "stuck"] {
        let error = build(&[bad]).unwrap_err();
        assert!(matches!(error, IdentifierError::Leaf { .. }), "{error}");
        assert!(error.to_string().contains("LF LM LR RF RM RR"), "{error}");
    }
    let error = build(&[]).unwrap_err();
    assert!(matches!(error, IdentifierError::NoLeaf), "{error}");
    let error = build(&["stuck:RM", "stuck:RM"]).unwrap_err();
    assert_eq!(
        error.to_string(),
        "leaves 'L0' and 'L1' stand for the same fault"
    );
}
