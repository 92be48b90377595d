use vigil_robot::tree::Node;

use super::*;

fn tree() -> FaultTree {
    let node = |name: &str, fault: Option<&str>| Node {
        name: name.to_owned(),
        parent: None,
        fault: fault.map(str::to_owned),
    };
    FaultTree::new(vec![
        node("ND", None),
        node("L1", Some("stuck:L1")),
        node("R-1", Some("stuck:R1")),
    ])
    .unwrap()
}

fn joint(states: &str, lost: Option<&str>) -> Result<Option<JointStates>, SupervisorError> {
    let text =
        format!("discount: 0.9\nvalues: reward\nstates: {states}\nactions: 1\nT: * identity\n");
    JointStates::new(&Pomdp::parse(&text).unwrap(), &tree(), lost)
}

const STATES: &str = "NOM NNP STUCK NNP-STUCK LST UNKNOWN";

#[test]
fn the_last_part_of_a_name_is_the_hardwares_if_the_tree_knows_it() {
    let joint = |states| joint(states, None).unwrap().unwrap();
    assert_eq!(joint(STATES).of_state, [0, 0, 1, 1, 0, 2]);
    // Of a leaf with the joint in its name, too; what stands before it is the navigation's.
    let own = joint("NOM R-1 L1 STUCK-L1 UNKNOWN DOOR-OPEN");
    assert_eq!(own.of_state, [0, 1, 2, 2, 3, 0]);
    assert_eq!(own.hardware[1].leaves, 4);
    assert_eq!(own.hardware[2].leaves, 2);
}

#[test]
fn a_model_of_navigation_alone_says_nothing_and_one_of_hardware_all_of_it() {
    assert!(joint("NOM NNP HP", None).unwrap().is_none());
    let refused = |states, lost| joint(states, lost).unwrap_err();
    let no_state = |name: &str| SupervisorError::NoState(name.to_owned());
    assert_eq!(refused("NOM STUCK", None), no_state("UNKNOWN"));
    assert_eq!(refused("NOM L1 UNKNOWN", None), no_state("R-1"));
    assert_eq!(refused("STUCK UNKNOWN", None), no_state("ND"));
    let lost = refused(STATES, Some("LOST")).to_string();
    assert!(
        lost.contains("'LOST'") && lost.contains("NOM, NNP"),
        "{lost}"
    );
    assert!(joint(STATES, Some("LST")).is_ok());
}

fn taken(lost: Option<&str>, hardware: [f64; 3], belief: [f64; 6]) -> [f64; 6] {
    let start = [0.5, 0.5, 0.0, 0.0, 0.0, 0.0];
    let mut taken = [f64::NAN; 6];
    let states = joint(STATES, lost).unwrap().unwrap();
    states.take_over(&hardware, &belief, &start, &mut taken);
    taken
}

fn assert_near(found: [f64; 6], expected: [f64; 6]) {
    let is_near = found
        .iter()
        .zip(expected)
        .all(|(f, e)| (f - e).abs() < 1e-12);
    assert!(is_near, "{found:?} {expected:?}");
}

#[test]
fn hardware_is_taken_over_and_the_navigation_given_it_stays() {
    let belief = [0.4, 0.3, 0.06, 0.04, 0.1, 0.1];
    let found = taken(None, [0.5, 0.4, 0.1], belief);
    assert_near(found, [0.25, 0.1875, 0.24, 0.16, 0.0625, 0.1]);
    assert_near(taken(None, [0.5, 0.4, 0.1], found), found);
}

#[test]
fn a_lost_robot_is_explained_by_unknown_where_that_is_likelier_than_nothing() {
    let belief = [0.4, 0.2, 0.1, 0.0, 0.15, 0.15];
    let found = taken(Some("LST"), [0.06, 0.04, 0.9], belief);
    assert_near(found, [0.04, 0.02, 0.04, 0.0, 0.45, 0.45]);
    assert_near(taken(Some("LST"), [0.06, 0.04, 0.9], found), found);
    // What jumped has jumped: nothing more is seen of it, and it is lost all the same.
    let found = taken(Some("LST"), [1.0, 0.0, 0.0], found);
    assert_near(found, [4.0 / 51.0, 2.0 / 51.0, 0.0, 0.0, 45.0 / 51.0, 0.0]);
}

#[test]
fn what_was_held_impossible_begins_as_a_run_does() {
    let stuck = [0.0, 0.0, 0.5, 0.5, 0.0, 0.0];
    let found = taken(None, [0.5, 0.0, 0.5], stuck);
    assert_near(found, [0.25, 0.25, 0.0, 0.0, 0.0, 0.5]);
}
