//! A fault that lasts an hour keeps its name: readings that two hypotheses explain alike move
//! nothing between them, and no prior adds up.

use vigil_blocks::{Entry, FaultBelief, ParticleBlock};
use vigil_diagnosis::Sensors;
use vigil_diagnosis::identify;
use vigil_diagnosis::identify::{Identifier, Input, LeafMap, Models};
use vigil_robot::Description;
use vigil_robot::slip::SlipModel;

use super::alarm::Alarm;
use super::driven::{Faults, ONSET_S, WHEELS, drive};
use crate::recorded::{model, path, robot};

const END_S: f64 = 3600.0;

/// Drives for an hour. From five seconds after the fault on, its set keeps a probability of .9. The
/// encoder of a wheel that stands is broken with 1 % at most: nothing shows it.
fn keeps_its_name(faults: Faults, seed: u64) {
    let (model, robot): (_, Description) = (model(), robot());
    let tree = vigil_setup::load_tree(&path("config/trees/rover.toml")).unwrap();
    let decision = vigil_setup::load_decision(&path("config/rover.pomdp")).unwrap();
    let risks = vigil_setup::state_risks(&decision).unwrap();
    let models = Models {
        model: &model,
        robot: &robot,
        tree: &tree,
        risks: Some(&risks),
    };
    let leaves = LeafMap::new(&tree, &model, &robot, Sensors::PoseEncoders).unwrap();
    let settings = identify::Settings::default();
    let mut identifier = Identifier::new(&models, &settings, Sensors::PoseEncoders, 1).unwrap();
    let slip = SlipModel::new(&robot).unwrap();
    let (frames, _) = drive(&robot, &slip, faults, (seed, END_S));
    let mut alarm = Alarm::between(ONSET_S + 0.1, f64::INFINITY);
    let (mut belief, mut hypotheses) = (FaultBelief::default(), Box::<ParticleBlock>::default());
    let truth = faults.nodes(&leaves);
    for frame in &frames {
        alarm.set(frame);
        let detection = Some((&alarm.belief, &*alarm.hypotheses));
        let entry = Entry::Frame(Input { frame, detection });
        identifier.step(entry, &mut belief, &mut hypotheses);
        let t_s = frame.header.t_capture_ns as f64 * 1e-9;
        if t_s < ONSET_S + 5.0 {
            continue;
        }
        let sets = &belief.sets[..belief.set_count as usize];
        let found = sets.iter().find(|set| set.leaves == truth);
        let p = found.map_or(0.0, |set| set.p);
        assert!(p >= 0.9, "{faults:?} after {t_s} s: {p}");
        let masked = (0..WHEELS).filter(|wheel| faults.stuck >> wheel & 1 == 1);
        let masked: Vec<f64> = masked
            .map(|wheel| belief.p[leaves.encoder[wheel].unwrap()])
            .collect();
        assert!(
            masked.iter().all(|p| *p <= 0.01),
            "{masked:?} after {t_s} s"
        );
        assert!(masked.iter().sum::<f64>() <= 0.05);
    }
}

#[test]
fn a_stuck_wheel_keeps_its_name_for_an_hour() {
    let stuck = 1 << 3;
    keeps_its_name(Faults { stuck, dead: 0 }, 703);
}

#[test]
fn a_dead_encoder_keeps_its_name_for_an_hour() {
    let dead = 1 << 4;
    keeps_its_name(Faults { stuck: 0, dead }, 710);
}

#[test]
fn all_wheels_stuck_stay_that_for_an_hour() {
    let stuck = (1 << WHEELS) - 1;
    keeps_its_name(Faults { stuck, dead: 0 }, 720);
}
