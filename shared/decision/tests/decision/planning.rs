//! Decisions by a policy that plans in the cycles.

use std::fs;

use vigil_blocks::{
    Action, ControlMode, DECISION_ACTIONS, DetectionBelief, RecoveryKind, Symptoms,
};
use vigil_cycle::allocation::allocations;
use vigil_decision::{Settings, Supervisor};
use vigil_setup::graph_file::GraphFile;
use vigil_setup::{Setup, load_graph};
use vigil_supervisor::assemble;

use crate::navigation::{by_the_papers_model, cycle_without_diagnosis};
use crate::world::{World, config};

fn planning(settings: &mut Settings) {
    settings.policy = "despot".to_owned();
}

/// A shipped graph that plans; every problem, if it is refused.
fn load(graph: &str, change: impl FnOnce(&mut Settings)) -> Result<Setup, String> {
    let change = |file: &mut GraphFile| {
        if file.navigation.is_some() {
            by_the_papers_model(file);
        }
        file.supervisor.policy_file = None;
        planning(&mut file.supervisor);
        change(&mut file.supervisor);
    };
    load_graph(&config().join(graph), change).map_err(|error| error.to_string())
}

#[test]
fn faults_are_met_by_plans_in_closed_loop() {
    let mut world = World::with(planning);
    world.rest(100, false, &[("ND", 0.9999), ("UNKNOWN", 0.0001)]);
    assert_eq!(world.kind(), RecoveryKind::GoOn);
    world.rest(20, true, &[("RM_STUCK", 0.999), ("ND", 0.001)]);
    assert_eq!(world.kind(), RecoveryKind::Compensate);
    assert_eq!(world.action.control_mode, ControlMode::Policy as u32);
    world.rest(100, false, &[("ND", 0.9999), ("UNKNOWN", 0.0001)]);
    assert_eq!(world.kind(), RecoveryKind::GoOn);
}

#[test]
fn what_the_spare_time_finds_shows_in_the_next_decision() {
    let mut world = World::with(planning);
    let doubt = [
        ("RM_STUCK", 0.4),
        ("RF_STUCK", 0.3),
        ("ND", 0.2),
        ("UNKNOWN", 0.1),
    ];
    world.cycle(true, &doubt, &doubt);
    let first = world.action.value;
    // A better plan for the same belief is worth more; until the next epoch nothing is said of it.
    world.rest(5, true, &doubt);
    assert_eq!(world.action.value, first);
    world.rest(20, true, &doubt);
    let best = |values: &[f64; DECISION_ACTIONS]| {
        values[..6]
            .iter()
            .copied()
            .fold(f64::NEG_INFINITY, f64::max)
    };
    assert!(best(&world.action.value) > best(&first), "{first:?}");
}

/// Symptoms come and go; the bits of all that is published.
fn exceptions(supervisor: &mut Supervisor) -> Vec<(u32, [u64; DECISION_ACTIONS])> {
    let (mut action, mut detection) = (Action::default(), DetectionBelief::default());
    let mut said = Vec::new();
    for cycle in 0..3000_u32 {
        let symptoms = match cycle / 500 % 3 {
            1 => Symptoms::EPM,
            2 => Symptoms::LD,
            _ => 0,
        };
        cycle_without_diagnosis(supervisor, symptoms, &mut detection, &mut action);
        said.push((action.action, action.value.map(f64::to_bits)));
    }
    said
}

#[test]
fn planning_allocates_nothing_and_a_replay_gives_equal_bits() {
    assert!(allocations() > 0, "the allocator does not count");
    let setup = load("corridor-obstacle.toml", |_| {}).unwrap();
    let live = exceptions(&mut assemble(&setup).unwrap());
    assert_eq!(live, exceptions(&mut assemble(&setup).unwrap()));
    assert!(live.iter().any(|said| said.0 != live[0].0));
}

#[test]
fn searches_that_no_cycle_has_time_for_are_refused_with_line_key_and_reason() {
    load("rover.toml", |_| {}).unwrap();
    let message = load("rover.toml", |settings| settings.despot.trials = 1000)
        .err()
        .unwrap();
    let part = "supervisor.despot.trials: 1000 trials with 64 scenarios take";
    assert!(message.contains(part), "{message}");
    assert!(
        message.contains("allowed are 2000000: choose fewer of either"),
        "{message}"
    );
    let message = load("rover.toml", |settings| settings.despot.scenarios = 0)
        .err()
        .unwrap();
    assert!(
        message.contains("supervisor.despot.scenarios: 0"),
        "{message}"
    );
    // What a solver has found may end a plan; a policy of another model may not.
    let solved = fs::read(config().join("rover.policy.json")).is_ok();
    assert!(solved);
    let with = |file: &'static str| {
        move |settings: &mut Settings| {
            settings.policy_file = Some(file.to_owned());
            (settings.despot.trials, settings.despot.scenarios) = (1, 1);
        }
    };
    load("rover.toml", with("rover.policy.json")).unwrap();
}
