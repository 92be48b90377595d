//! Missions recorded from a model.

use vigil_missions::learning::Record;
use vigil_missions::simulation::{Episode, Random, Rules};
use vigil_pomdp::Pomdp;

/// `count` missions of `steps` actions taken at random, with the states if `labelled`.
pub fn missions(model: &Pomdp, seed: u64, count: u64, steps: usize, labelled: bool) -> Vec<Record> {
    let rules = Rules {
        steps_max: steps,
        is_end: vec![false; model.actions().len()],
    };
    let mut agent = Random::new(model.actions().len());
    let one = |e| {
        Record::simulated(
            model,
            &mut agent,
            &rules,
            Episode { seed, number: e },
            labelled,
        )
        .0
    };
    (0..count).map(one).collect()
}
