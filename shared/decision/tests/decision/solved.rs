//! Decisions by a policy that was solved beforehand, read from a file.

use std::fs;
use std::path::Path;

use tempfile::TempDir;
use vigil_blocks::{
    Action, ControlMode, DetectionBelief, Entry, FaultBelief, RecoveryKind, Symptoms, ValueKind,
};
use vigil_cycle::allocation::allocations;
use vigil_decision::{Inputs, Supervisor};
use vigil_pomdp::policy_file::PolicyFile;
use vigil_pomdp::solver::{Options, solve};
use vigil_pomdp::{AlphaVectors, Budget, Pomdp};
use vigil_setup::graph_file::GraphFile;
use vigil_setup::{Setup, load_graph};
use vigil_supervisor::assemble;

use crate::navigation::{by_the_papers_model, cycle_without_diagnosis};
use crate::world::{CYCLE_NS, config};

fn model(name: &str) -> Pomdp {
    Pomdp::parse(&fs::read_to_string(config().join(name)).unwrap()).unwrap()
}

/// A policy file of the shipped model `name`, as `vigil pomdp solve` writes it: the shipped one, or
/// of a model that ships without.
fn solved(name: &str) -> Vec<u8> {
    if let Ok(shipped) = fs::read(config().join(name.replace(".pomdp", ".policy.json"))) {
        return shipped;
    }
    let model = model(name);
    let options = Options {
        precision: 0.15,
        ..Options::default()
    };
    let found = solve(
        &model,
        &options,
        &mut Budget::new(&mut || false),
        &mut |_| (),
    )
    .unwrap();
    file(&model, found.bracket.lower, found.vectors.unwrap())
}

fn file(model: &Pomdp, lower: f64, vectors: AlphaVectors) -> Vec<u8> {
    let file = PolicyFile {
        model_hash: model.hash(),
        discount: model.discount(),
        method: "sarsop".to_owned(),
        lower,
        upper: None,
        cpu_s: 0.0,
        vectors,
    };
    file.write(model).unwrap()
}

/// A shipped graph that decides by the policy in `path`; every problem, if it is refused.
fn load(graph: &str, path: &Path) -> Result<Setup, String> {
    let change = |file: &mut GraphFile| {
        if file.navigation.is_some() {
            // It is small enough to be solved here.
            by_the_papers_model(file);
        }
        file.supervisor.policy = "point-based".to_owned();
        file.supervisor.policy_file = Some(path.to_str().unwrap().to_owned());
    };
    load_graph(&config().join(graph), change).map_err(|error| error.to_string())
}

fn supervisor(graph: &str, decision: &str) -> (Setup, Supervisor) {
    let folder = TempDir::new().unwrap();
    let path = folder.path().join("policy.json");
    fs::write(&path, solved(decision)).unwrap();
    let setup = load(graph, &path).unwrap();
    let supervisor = assemble(&setup).unwrap();
    (setup, supervisor)
}

/// What every decision publishes.
fn demand_complete(action: &Action) {
    let values = &action.value[..action.action_count as usize];
    assert!(values.iter().all(|v| v.is_finite()), "{values:?}");
    assert_eq!(action.value_kind, ValueKind::Value as u32);
    assert!((0.0..=1.0).contains(&action.action_entropy) && action.margin >= 0.0);
    assert!((0.0..=1.0).contains(&action.entropy));
}

#[test]
fn faults_are_met_by_a_solved_policy_without_allocating() {
    let (setup, mut first) = supervisor("rover.toml", "rover.pomdp");
    let mut action = Action::default();
    let mut diagnosis = FaultBelief {
        tree_hash: setup.tree.hash(),
        ..FaultBelief::default()
    };
    let mut kind_after = |supervisor: &mut Supervisor, stuck: f64, unknown: f64, cycles: usize| {
        let wheel = setup.tree.index("RM_STUCK").unwrap();
        diagnosis.identifying = u32::from(stuck + unknown > 0.1);
        let nominal = 1.0 - stuck - unknown;
        for p in [&mut diagnosis.p, &mut diagnosis.p_predicted] {
            (p[0], p[wheel]) = (nominal, stuck);
        }
        (diagnosis.p_unknown, diagnosis.p_unknown_predicted) = (unknown, unknown);
        for _ in 0..cycles {
            diagnosis.header.t_capture_ns += CYCLE_NS;
            let mut detection = DetectionBelief {
                alarm: diagnosis.identifying,
                ..DetectionBelief::default()
            };
            detection.header.t_capture_ns = diagnosis.header.t_capture_ns;
            let inputs = Inputs {
                diagnosis: Some(&diagnosis),
                detection: Some(&detection),
            };
            let before = allocations();
            assert!(before > 0, "the allocator does not count");
            supervisor.step(Entry::Frame(inputs), &mut action);
            assert_eq!(allocations() - before, 0);
            demand_complete(&action);
        }
        RecoveryKind::from_repr(action.kind).unwrap()
    };
    assert_eq!(kind_after(&mut first, 0.0, 1e-4, 50), RecoveryKind::GoOn);
    assert_eq!(
        kind_after(&mut first, 0.999, 0.0, 5),
        RecoveryKind::Compensate
    );
    let (_, mut fresh) = supervisor("rover.toml", "rover.pomdp");
    // What no model explains, and may yet be nothing: caution first, and as nothing more comes of
    // it, the call.
    let kind = kind_after(&mut fresh, 0.0, 0.9, 1);
    assert!(
        matches!(kind, RecoveryKind::Stop | RecoveryKind::SlowDown),
        "{kind:?}"
    );
    assert_eq!(
        kind_after(&mut fresh, 0.0, 0.9, 400),
        RecoveryKind::CallForHelp
    );
}

#[test]
fn exceptions_are_met_by_a_solved_policy_without_allocating() {
    let (_, mut supervisor) = supervisor("corridor-obstacle.toml", "navigation.pomdp");
    let (mut action, mut detection) = (Action::default(), DetectionBelief::default());
    let mut kinds = Vec::new();
    for cycle in 0..8000 {
        let symptoms = if cycle < 2000 { 0 } else { Symptoms::EPM };
        cycle_without_diagnosis(&mut supervisor, symptoms, &mut detection, &mut action);
        demand_complete(&action);
        assert_eq!(action.control_mode, ControlMode::Policy as u32);
        let kind = RecoveryKind::from_repr(action.kind).unwrap();
        if kinds.last() != Some(&kind) {
            kinds.push(kind);
        }
    }
    // Off the path while moving, again and again, whatever is done.
    let begin = [RecoveryKind::GoOn, RecoveryKind::GoThrough];
    assert_eq!(kinds[..2], begin, "{kinds:?}");
    assert!(kinds.len() > 2, "{kinds:?}");
}

#[test]
fn files_that_do_not_fit_are_refused_with_line_key_and_reason() {
    let folder = TempDir::new().unwrap();
    let path = folder.path().join("policy.json");
    let refused = |bytes: &[u8]| {
        fs::write(&path, bytes).unwrap();
        let message = load("rover.toml", &path).err().unwrap();
        let line = message.split(':').nth(1).unwrap().to_owned();
        let text = fs::read_to_string(config().join("rover.toml")).unwrap();
        let is_key = |line: &str| line.starts_with("policy_file");
        let at = text.lines().position(is_key).unwrap();
        assert_eq!(line, (at + 1).to_string(), "{message}");
        let key = "supervisor.policy_file: ";
        let (_, reason) = message.split_once(key).unwrap();
        reason.to_owned()
    };
    let own = solved("rover.pomdp");
    let other = refused(&solved("navigation.pomdp"));
    assert!(other.contains("solved for the model"), "{other}");
    let cut = refused(&own[..own.len() / 2]);
    assert!(cut.contains("policy.json: line 1, column"), "{cut}");
    let model = model("rover.pomdp");
    let states = model.states().len();
    let many = (0..5200).map(|i| (i % model.actions().len(), vec![-1.0; states]));
    let many = AlphaVectors::new(states, model.actions().len(), many).unwrap();
    let many = refused(&file(&model, -1.0, many));
    assert!(
        many.contains("multiplications, allowed are 40000"),
        "{many}"
    );
    let missing = load("rover.toml", &folder.path().join("none"))
        .err()
        .unwrap();
    assert!(missing.contains("cannot be read"), "{missing}");
    let change = |file: &mut GraphFile| file.supervisor.policy_file = None;
    let message = load_graph(&config().join("rover.toml"), change)
        .err()
        .unwrap();
    assert!(
        message
            .to_string()
            .contains("requires supervisor.policy_file"),
        "{message}"
    );
    let change = |file: &mut GraphFile| file.supervisor.policy = "qmdp".to_owned();
    let message = load_graph(&config().join("rover.toml"), change)
        .err()
        .unwrap();
    let part = "policy_file: has a meaning only with supervisor.policy = \"point-based\" or";
    assert!(message.to_string().contains(part), "{message}");
}
