//! How far an encoder is off, on recorded healthy runs whose readings are changed by a known size.

use vigil_blocks::{Entry, FaultBelief, ParticleBlock, SensorFrame, SizeKind};
use vigil_diagnosis::Sensors;
use vigil_diagnosis::identify;
use vigil_diagnosis::identify::{Identifier, Input, Models};

use super::alarm;
use crate::recorded;

/// When the encoder of LM breaks, s after the first frame.
const ONSET_S: f64 = 3.0;
const LM: usize = 1;
/// A healthy run that the model has not seen, at one speed: a gain and a bias read alike, and
/// the sizes below are those of which the prior knows what they are.
const RUN: u32 = 2;

fn frames() -> Vec<SensorFrame> {
    let (runs, _) = recorded::runs();
    let run = runs.iter().find(|run| run.id == RUN);
    run.unwrap().frames.clone()
}

/// The belief at the end of the healthy run when encoder LM reads `read(rate, s since the onset)`
/// from the onset on; the alarm rises half a second later.
fn belief(read: impl Fn(f64, f64) -> f64) -> (FaultBelief, usize) {
    let mut frames = frames();
    let start_s = time_s(&frames[0]);
    let tree = vigil_setup::load_tree(&recorded::path("config/trees/rover.toml")).unwrap();
    let decision = vigil_setup::load_decision(&recorded::path("config/rover.pomdp")).unwrap();
    let risks = vigil_setup::state_risks(&decision).unwrap();
    let (model, robot) = (recorded::model(), recorded::robot());
    let models = Models {
        model: &model,
        robot: &robot,
        tree: &tree,
        risks: Some(&risks),
    };
    let settings = identify::Settings::default();
    let sensors = Sensors::PoseEncoders;
    let mut identifier = Identifier::new(&models, &settings, sensors, 1).unwrap();
    let mut belief = FaultBelief::default();
    let mut hypotheses: Box<ParticleBlock> = Box::default();
    let mut alarm = alarm::Alarm::between(start_s + ONSET_S + 0.5, f64::INFINITY);
    for frame in &mut frames {
        let since_s = time_s(frame) - start_s - ONSET_S;
        if since_s >= 0.0 {
            frame.channel[3 + LM] = read(frame.channel[3 + LM], since_s);
        }
        alarm.set(frame);
        let detection = Some((&alarm.belief, &*alarm.hypotheses));
        let entry = Entry::Frame(Input { frame, detection });
        identifier.step(entry, &mut belief, &mut hypotheses);
    }
    (belief, tree.index("LM_ENC").unwrap())
}

fn time_s(frame: &SensorFrame) -> f64 {
    frame.header.t_capture_ns as f64 * 1e-9
}

fn check(read: impl Fn(f64, f64) -> f64, kind: SizeKind, size: f64) {
    let (belief, leaf) = belief(read);
    assert_eq!(belief.mode as usize, leaf, "{kind:?} {size}");
    let found = (belief.size[leaf], belief.size_sd[leaf]);
    let way = SizeKind::from_wire(belief.size_kind[leaf]);
    assert_eq!(way, kind, "{size}: {found:?}");
    assert!((found.0 - size).abs() < 0.1 * size.abs(), "{found:?}");
    assert!(found.1 < 0.1 * size.abs(), "{found:?}");
}

#[test]
fn a_gain_is_told_with_its_size() {
    check(|rate, _| 0.5 * rate, SizeKind::Gain, 0.5);
    check(|rate, _| 0.7 * rate, SizeKind::Gain, 0.7);
}

#[test]
fn a_bias_is_told_with_its_size() {
    check(|rate, _| rate + 0.6, SizeKind::BiasRadS, 0.6);
    check(|rate, _| rate - 0.4, SizeKind::BiasRadS, -0.4);
}

#[test]
fn a_drift_is_told_with_its_size() {
    check(|rate, t_s| rate + 0.15 * t_s, SizeKind::DriftRadS2, 0.15);
}

#[test]
fn what_has_no_size_is_told_by_its_way() {
    let (belief, leaf) = belief(|_, _| 0.0);
    let told = SizeKind::from_wire(belief.size_kind[leaf]);
    assert_eq!((belief.mode as usize, told), (leaf, SizeKind::Zero));
    assert_eq!((belief.size[leaf], belief.size_sd[leaf]), (0.0, 0.0));
}

#[test]
fn nothing_is_told_of_a_healthy_robot() {
    let (belief, leaf) = belief(|rate, _| rate);
    assert!(belief.p[leaf] < 0.05);
    assert_eq!(belief.size_kind[leaf], 0);
}
