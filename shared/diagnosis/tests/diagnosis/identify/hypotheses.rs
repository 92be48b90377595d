//! What the identifier takes of the detector's block, what it keeps, and what it sheds.

use vigil_blocks::{Entry, FaultBelief, HealthyBelief, ParticleBlock, SensorFrame};
use vigil_diagnosis::Sensors;
use vigil_diagnosis::identify;
use vigil_diagnosis::identify::{Identifier, Input, Models};
use vigil_robot::FaultTree;

use super::alarm::Alarm;
use crate::recorded;

/// The default filter on a run whose wheel RM sticks.
struct Bench {
    identifier: Identifier,
    frames: Vec<SensorFrame>,
    tree: FaultTree,
    alarm: Alarm,
    belief: FaultBelief,
    hypotheses: Box<ParticleBlock>,
}

impl Bench {
    fn new() -> Self {
        let (frames, label) = recorded::unseen("RM_STUCK", "stuck");
        let tree = vigil_setup::load_tree(&recorded::path("config/trees/rover.toml")).unwrap();
        let models = Models {
            model: &recorded::model(),
            robot: &recorded::robot(),
            tree: &tree,
            risks: None,
        };
        let settings = identify::Settings::default();
        let sensors = Sensors::PoseEncoders;
        Self {
            identifier: Identifier::new(&models, &settings, sensors, 1).unwrap(),
            frames,
            tree,
            alarm: Alarm::between(label.onset_s.unwrap() + 0.4, 99.0),
            belief: FaultBelief::default(),
            hypotheses: Box::default(),
        }
    }

    /// Steps all frames; `change` is made of each detection, `look` takes what came of it.
    fn run(&mut self, change: impl Fn(&mut Alarm), mut look: impl FnMut(&Self)) {
        for frame in std::mem::take(&mut self.frames) {
            self.alarm.set(&frame);
            change(&mut self.alarm);
            let detection = Some((&self.alarm.belief, &*self.alarm.hypotheses));
            let entry = Entry::Frame(Input {
                frame: &frame,
                detection,
            });
            self.identifier
                .step(entry, &mut self.belief, &mut self.hypotheses);
            look(self);
        }
    }
}

#[test]
fn a_budget_lowers_the_number_of_hypotheses_and_a_stuck_wheel_is_still_named() {
    let most = |budget: Option<u32>| {
        let mut bench = Bench::new();
        if let Some(count) = budget {
            let (belief, out) = (&mut bench.belief, &mut bench.hypotheses);
            bench.identifier.step(Entry::Budget(count), belief, out);
            assert_eq!(bench.belief.particle_limit, count);
        }
        let mut most = 0;
        bench.run(
            |_| {},
            |bench| most = most.max(bench.identifier.particles_in_use()),
        );
        let named = &bench.tree.nodes()[bench.belief.mode as usize].name;
        assert_eq!(named, "RM_STUCK", "{budget:?}");
        most
    };
    let (all, few) = (most(None), most(Some(32)));
    assert!(few <= 32 && all > 64, "{few} of {all}");
}

#[test]
fn an_identification_starts_from_the_block_of_hypotheses() {
    let p_of = |forward: f64| {
        let mut bench = Bench::new();
        let change = |alarm: &mut Alarm| alarm.hypotheses.healthy.deviation[1] = forward;
        bench.run(change, |bench| {
            let (told, detected) = (&bench.hypotheses, &bench.alarm.hypotheses);
            let is_repeated = told.healthy == detected.healthy && told.used() == detected.used();
            assert!(is_repeated || bench.belief.identifying != 0);
        });
        assert_eq!(bench.hypotheses.healthy, HealthyBelief::default());
        bench.belief.p
    };
    assert_eq!(p_of(0.0), p_of(0.0));
    assert_ne!(p_of(0.0), p_of(0.01));
}
