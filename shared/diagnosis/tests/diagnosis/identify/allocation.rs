//! A steady cycle of the identifier allocates nothing.

use clap::ValueEnum;
use vigil_blocks::{Entry, FaultBelief, ParticleBlock};
use vigil_cycle::allocation::allocations;
use vigil_diagnosis::Sensors;
use vigil_diagnosis::identify;
use vigil_diagnosis::identify::IdentifierFilter;
use vigil_diagnosis::identify::{Identifier, Input, Models};

use super::alarm;
use crate::recorded;

#[test]
fn steady_cycles_of_every_filter_allocate_nothing() {
    let (frames, label) = recorded::unseen("RM_STUCK", "stuck");
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
    for &filter in IdentifierFilter::value_variants() {
        let settings = identify::Settings {
            filter,
            ..identify::Settings::default()
        };
        let sensors = Sensors::PoseEncoders;
        let mut identifier = Identifier::new(&models, &settings, sensors, 1).unwrap();
        let mut belief = FaultBelief::default();
        let mut hypotheses: Box<ParticleBlock> = Box::default();
        let mut alarm = alarm::Alarm::between(label.onset_s.unwrap() + 0.5, 99.0);
        let before = allocations();
        for (cycle, frame) in frames.iter().enumerate() {
            if cycle % 100 == 0 {
                // Fewer hypotheses or particles, and all of them again.
                let count = [64, identifier.particles()][cycle / 100 % 2];
                identifier.step(Entry::Budget(count), &mut belief, &mut hypotheses);
                assert_eq!(belief.particle_limit, count);
            }
            alarm.set(frame);
            let detection = Some((&alarm.belief, &*alarm.hypotheses));
            let entry = Entry::Frame(Input { frame, detection });
            identifier.step(entry, &mut belief, &mut hypotheses);
            identifier.step(Entry::Missed(1), &mut belief, &mut hypotheses);
        }
        identifier.step(Entry::Budget(64), &mut belief, &mut hypotheses);
        assert_eq!(allocations() - before, 0, "{filter}");
        // It did identify. Few samples of the prior find a rare fault: they may name another.
        let leaf = tree.index("RM_STUCK").unwrap();
        let is_right = belief.mode as usize == leaf;
        assert!(
            is_right || filter == IdentifierFilter::Bootstrap && belief.mode != 0,
            "{filter}"
        );
    }
}

#[test]
fn steady_cycles_with_every_channel_allocate_nothing() {
    const STEER_RF: usize = 11;
    let (mut frames, label) = recorded::unseen("RM_STUCK", "stuck");
    let tree = vigil_setup::load_tree(&recorded::path("config/trees/rover-all.toml")).unwrap();
    let (model, robot) = (recorded::model(), recorded::robot());
    let models = Models {
        model: &model,
        robot: &robot,
        tree: &tree,
        risks: None,
    };
    let settings = identify::Settings::default();
    let mut identifier = Identifier::new(&models, &settings, Sensors::All, 1).unwrap();
    let mut belief = FaultBelief::default();
    let mut hypotheses: Box<ParticleBlock> = Box::default();
    let onset_s = label.onset_s.unwrap();
    let mut alarm = alarm::Alarm::between(onset_s + 0.5, 99.0);
    let before = allocations();
    for frame in &mut frames {
        // A servo slips, and the pose is silent for a while.
        let t_s = frame.header.t_capture_ns as f64 * 1e-9;
        if t_s > onset_s + 3.0 {
            frame.channel[STEER_RF] += 0.2;
        }
        if t_s > onset_s + 5.0 && t_s < onset_s + 6.0 {
            frame.channel_valid &= !0b111;
        }
        alarm.set(frame);
        let detection = Some((&alarm.belief, &*alarm.hypotheses));
        let entry = Entry::Frame(Input { frame, detection });
        identifier.step(entry, &mut belief, &mut hypotheses);
    }
    assert_eq!(allocations() - before, 0);
    assert!(belief.mode != 0);
}
