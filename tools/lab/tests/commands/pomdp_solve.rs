//! `vigil pomdp solve` as a user runs it.

use std::fs;
use std::process::{Command, Output};

use serde_json::Value;
use vigil_pomdp::policy_file::{PolicyFile, alpha, appl};
use vigil_pomdp::{Pomdp, mdp};

use super::workplace::root;

const TIGER: &str = "discount: 0.95\nstates: left right\nactions: listen open-left open-right\n\
    observations: hear-left hear-right\nT: * uniform\nT: listen identity\nO: * uniform\n\
    O: listen\n0.85 0.15\n0.15 0.85\nR: listen : * : * : * -1\n\
    R: open-left : left : * : * -100\nR: open-left : right : * : * 10\n\
    R: open-right : left : * : * 10\nR: open-right : right : * : * -100\n";

fn solve(arguments: &[&str]) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_vigil-lab"));
    command
        .args(["pomdp", "solve"])
        .args(arguments)
        .output()
        .unwrap()
}

fn document(arguments: &[&str]) -> Value {
    let output = solve(&[arguments, &["--json"]].concat());
    assert_eq!(output.status.code(), Some(0), "{output:?}");
    serde_json::from_slice(&output.stdout).unwrap()
}

#[test]
fn every_method_gives_its_bound_and_null_for_the_other() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("tiger.pomdp");
    fs::write(&file, TIGER).unwrap();
    let file = file.to_str().unwrap();
    let cases = [
        ("mdp", None, Some(200.0)),
        ("blind", Some(-20.0), None),
        ("qmdp", None, Some(189.0)),
        ("fib", None, Some(87.179_487_18)),
        ("tib", None, Some(49.605_609_1)),
        ("sarsop", Some(19.371_368), Some(19.371_368)),
    ];
    for (method, lower, upper) in cases {
        let found = document(&[file, "--method", method, "--precision", "1e-6"]);
        for (key, wanted) in [("lower", lower), ("upper", upper)] {
            let value = found[key].as_f64();
            assert_eq!(value.is_some(), wanted.is_some(), "{method}: {found}");
            let error = value.unwrap_or(0.0) - wanted.unwrap_or(0.0);
            assert!(error.abs() < 2e-6, "{method}, {key}: {found}");
        }
        assert!(found["cpu_s"].as_f64().unwrap() > 0.0);
        assert_eq!(found["ended"], "precision");
    }
}

#[test]
fn the_policy_is_written_in_all_formats() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("tiger.pomdp");
    fs::write(&file, TIGER).unwrap();
    let model = Pomdp::parse(TIGER).unwrap();
    let write = |name: &str| {
        let out = folder.path().join(name);
        let found = document(&[file.to_str().unwrap(), "--out", out.to_str().unwrap()]);
        (fs::read(out).unwrap(), found)
    };
    let (bytes, found) = write("tiger.json");
    let policy = PolicyFile::read(&bytes, &model).unwrap();
    assert_eq!(Some(policy.lower), found["lower"].as_f64());
    assert!((policy.vectors.value(model.start()) - policy.lower).abs() < 1e-6);
    assert_eq!(policy.method, "sarsop");
    let (xml, text) = (write("tiger.policy").0, write("tiger.alpha").0);
    let xml = appl::read(std::str::from_utf8(&xml).unwrap(), &model).unwrap();
    let text = alpha::read(std::str::from_utf8(&text).unwrap(), &model).unwrap();
    assert_eq!((&xml, &text), (&policy.vectors, &policy.vectors));
    // Nothing better can be seen than the state.
    let best = mdp::solve(&model).unwrap().value(0);
    assert!(
        policy
            .vectors
            .rows()
            .all(|(_, values)| values.iter().all(|v| *v <= best + 1e-9))
    );
}

#[test]
fn costs_are_negative_rewards_and_said_to_be() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("costs.pomdp");
    fs::write(&file, format!("values: cost\n{TIGER}")).unwrap();
    let output = solve(&[file.to_str().unwrap(), "--method", "mdp"]);
    let text = String::from_utf8(output.stdout).unwrap();
    assert!(text.contains("costs") && text.contains("2000.0"), "{text}");
}

#[test]
fn a_timeout_leaves_a_bracket() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("tiger.pomdp");
    fs::write(&file, TIGER).unwrap();
    let arguments = [
        file.to_str().unwrap(),
        "--precision",
        "0",
        "--timeout",
        "0.05",
    ];
    let found = document(&arguments);
    let bound = |key: &str| found[key].as_f64().unwrap();
    assert!(
        bound("lower") <= 19.371_369 && bound("upper") >= 19.371_368,
        "{found}"
    );
}

#[test]
fn wrong_options_are_refused() {
    let shipped = root().join("config/rover.pomdp");
    let shipped = shipped.to_str().unwrap();
    let cases: [(&[&str], &str); 4] = [
        (&["--method", "magic"], "sarsop"),
        (&["--timeout", "-1"], "--timeout"),
        (&["--precision", "nan"], "--precision"),
        (&["--method", "fib", "--out", "x"], "--out"),
    ];
    for (options, part) in cases {
        let output = solve(&[&[shipped], options].concat());
        assert_eq!(output.status.code(), Some(2), "{options:?}");
        let text = String::from_utf8(output.stderr).unwrap();
        assert!(text.contains(part), "{options:?}: {text}");
    }
}

#[test]
fn a_policys_value_is_bounded_and_sampled() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name).to_str().unwrap().to_owned();
    let (file, policy) = (path("tiger.pomdp"), path("tiger.json"));
    fs::write(&file, TIGER).unwrap();
    let solved = document(&[&file, "--precision", "1e-6", "--out", &policy]);
    let value = |arguments: &[&str]| {
        let mut command = Command::new(env!("CARGO_BIN_EXE_vigil-lab"));
        command.args(["pomdp", "value", &file, &policy]);
        command.args(arguments).output().unwrap()
    };
    let output = value(&["--json"]);
    let found: Value = serde_json::from_slice(&output.stdout).unwrap();
    let number = |key: &str| found[key].as_f64().unwrap();
    assert!(
        (number("lower") - solved["policy_lower"].as_f64().unwrap()).abs() < 1e-5,
        "{found}"
    );
    assert!(number("upper") - number("lower") < 1e-6);
    assert_eq!((number("beyond_share"), number("beliefs")), (0.0, 5.0));
    let distance = (number("mean") - number("lower")).abs();
    assert!(distance < 2.0 * number("half_width_95"), "{found}");
    let text = String::from_utf8(value(&["--episodes", "10"]).stdout).unwrap();
    assert!(
        text.contains("for certain: 5 beliefs") && text.contains("10 missions of"),
        "{text}"
    );
    fs::write(&policy, "{}").unwrap();
    let refused = value(&[]);
    assert_eq!(refused.status.code(), Some(2), "{refused:?}");
}

#[test]
fn a_goal_problem_is_solved_valued_and_simulated_with_discount_one() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name).to_str().unwrap().to_owned();
    let (file, policy, missions) = (path("search.pomdp"), path("p.json"), path("missions"));
    // Left with 3/4, else right; a look costs 1 and never misses: 1.25 looks.
    let text = "discount: 1\nvalues: cost\nstates: left right found\n\
        actions: look-left look-right\nobservations: nothing it\nstart: 0.75 0.25 0\n\
        T: * identity\nT: look-left : left 0 0 1\nT: look-right : right 0 0 1\n\
        O: * : * 1 0\nO: * : found 0 1\nR: * : left : * : * 1\nR: * : right : * : * 1\n";
    fs::write(&file, text).unwrap();
    let solved = document(&[&file, "--precision", "1e-6", "--out", &policy]);
    assert_eq!(solved["ended"], "precision");
    for key in ["lower", "upper", "policy_lower"] {
        assert!(
            (solved[key].as_f64().unwrap() + 1.25).abs() < 1e-6,
            "{solved}"
        );
    }
    let run = |arguments: &[&str]| {
        let mut command = Command::new(env!("CARGO_BIN_EXE_vigil-lab"));
        command.arg("pomdp").args(arguments).output().unwrap()
    };
    let valued = run(&["value", &file, &policy, "--json", "--episodes", "400"]);
    let valued: Value = serde_json::from_slice(&valued.stdout).unwrap();
    for key in ["lower", "upper"] {
        assert!(
            (valued[key].as_f64().unwrap() + 1.25).abs() < 1e-6,
            "{valued}"
        );
    }
    assert!(
        (valued["mean"].as_f64().unwrap() + 1.25).abs() < 0.15,
        "{valued}"
    );
    let arguments = ["simulate", &file, "--policy", "qmdp", "--out", &missions];
    assert!(run(&arguments).status.success());
    let lines = fs::read_to_string(&missions).unwrap();
    // A mission ends where it is found, at the second look at the latest.
    assert!(
        lines
            .lines()
            .skip(1)
            .all(|line| line.matches("look-").count() <= 2)
    );
    fs::write(
        &file,
        text.replace("look-left : left 0 0 1", "look-left : left 1 0 0"),
    )
    .unwrap();
    let refused = run(&["solve", &file]);
    let message = String::from_utf8(refused.stderr).unwrap();
    assert!(
        !refused.status.success() && message.contains("from 'left' there is none"),
        "{message}"
    );
}
