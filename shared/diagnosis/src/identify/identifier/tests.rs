//! An identifier whose state contradicts itself ends the process.

use super::*;
use crate::rover::Rover;

/// Steps a sound identifier, and again after `corrupt`. The entry changes nothing by itself.
fn step_after(corrupt: impl FnOnce(&mut Identifier)) {
    let mut identifier = Rover::new().identifier();
    let (mut belief, mut hypotheses) = (FaultBelief::default(), Box::default());
    identifier.step(Entry::Missed(1), &mut belief, &mut hypotheses);
    assert_eq!((belief.mode, belief.p[0]), (0, 1.0));
    corrupt(&mut identifier);
    identifier.step(Entry::Missed(1), &mut belief, &mut hypotheses);
}

#[test]
#[should_panic(expected = "the probability of each node is within [0, 1]")]
fn a_node_above_one_ends_the_process() {
    step_after(|identifier| identifier.posterior.nodes[1] = 1.1);
}

#[test]
#[should_panic(expected = "nominal, faults and unknown account for one")]
fn a_belief_that_leaves_some_out_ends_the_process() {
    step_after(|identifier| identifier.posterior.nodes[0] = 0.5);
}

#[test]
#[should_panic(expected = "exact sets sum to one at most")]
fn sets_above_one_end_the_process() {
    step_after(|identifier| identifier.posterior.sets[0].p = 1.1);
}

#[test]
#[should_panic(expected = "exact sets sum to one at most")]
fn sets_in_another_order_end_the_process() {
    step_after(|identifier| {
        let posterior = &mut identifier.posterior;
        (posterior.sets[0].p, posterior.sets[1].p) = (0.3, 0.4);
        posterior.set_count = 2;
    });
}

#[test]
#[should_panic(expected = "entropy is within [0, ln n]")]
fn an_entropy_below_zero_ends_the_process() {
    step_after(|identifier| identifier.posterior.entropy = -1e-6);
}

#[test]
#[should_panic(expected = "a reported name is a node of the tree")]
fn a_reported_name_beyond_the_tree_ends_the_process() {
    step_after(|identifier| {
        let (mut belief, beyond) = (identifier.posterior, identifier.leaves.nodes as u32);
        belief.nodes[0] = 0.0;
        identifier
            .reported
            .take(beyond, 1.0, &belief, &identifier.leaves, 0.0);
    });
}

#[test]
#[should_panic(expected = "an onset is never after now")]
fn an_onset_after_the_newest_observation_ends_the_process() {
    step_after(|identifier| {
        // The ring holds nothing yet, and the encoder is said to have broken at 5 ns.
        let encoder = identifier.leaves.encoder[0].unwrap();
        identifier.posterior.nodes[0] = 0.0;
        identifier.posterior.nodes[encoder] = 1.0;
        identifier.engine.restart(&identifier.unsure, 5);
        identifier.phase = Phase::Identifying(0);
        identifier.is_heard = true;
    });
}
