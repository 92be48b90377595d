//! `vigil pomdp simulate`, `learn` and `picture` as a user sees them.

use std::fs;
use std::path::Path;
use std::process::{Command, Output};

use serde_json::Value;
use tempfile::TempDir;
use vigil_pomdp::Pomdp;

use super::workplace::root;

const MODEL: &str = "config/navigation.pomdp";

/// Waiting for a lamp that is seen dimly; pressing may switch it on.
const LAMP: &str = "discount: 0.8
values: reward
states: on off
actions: wait press
observations: light dark
start: 0.5 0.5
T: wait identity
T: press
0.9 0.1
0.6 0.4
O: *
0.95 0.05
0.1 0.9
R: * : on : * : * 1
R: press : * : * : * -0.5
";

fn run(arguments: &[&str]) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_vigil-lab"));
    let command = command.args(arguments).current_dir(root());
    command.output().unwrap()
}

fn done(arguments: &[&str]) -> String {
    let output = run(arguments);
    let errors = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(output.status.success() && errors.is_empty(), "{errors}");
    String::from_utf8(output.stdout).unwrap()
}

fn refused(arguments: &[&str], code: i32) -> String {
    let output = run(arguments);
    assert_eq!(output.status.code(), Some(code), "{output:?}");
    String::from_utf8(output.stderr).unwrap()
}

struct Folder(TempDir);

impl Folder {
    fn new() -> Self {
        Self(TempDir::new().unwrap())
    }

    fn path(&self, name: &str) -> String {
        self.0.path().join(name).to_str().unwrap().to_owned()
    }

    fn write(&self, name: &str, text: &str) -> String {
        let path = self.path(name);
        fs::write(&path, text).unwrap();
        path
    }
}

#[test]
fn missions_are_recorded_learned_from_and_checked() {
    let folder = Folder::new();
    let truth = folder.write("truth.pomdp", LAMP);
    let hand = LAMP.replace("0.9 0.1\n0.6 0.4", "0.8 0.2\n0.3 0.7");
    let hand = folder.write("hand.pomdp", &hand);
    let (log, out) = (folder.path("missions.jsonl"), folder.path("learned.pomdp"));
    let simulate = ["pomdp", "simulate", &truth, "--policy", "random"];
    let options = ["--episodes", "1500", "--seed", "7", "--out", &log];
    assert_eq!(done(&[&simulate[..], &options].concat()), "");
    let text = fs::read_to_string(&log).unwrap();
    assert_eq!(text.lines().count(), 1501);
    let head: Value = serde_json::from_str(text.lines().next().unwrap()).unwrap();
    assert_eq!(
        (&head["format"], &head["policy"]),
        (&"vigil-missions".into(), &"random".into())
    );

    let learn = [
        "pomdp",
        "learn",
        &hand,
        "--missions",
        &log,
        "--out",
        &out,
        "--world",
        &truth,
    ];
    let json = done(&[&learn[..], &["--json", "--prior-strength", "10"]].concat());
    let document: Value = serde_json::from_str(&json).unwrap();
    assert_eq!(
        (&document["refused"], &document["missions"]),
        (&Value::Null, &1500.into())
    );
    let iterations = document["iterations"].as_array().unwrap();
    let objective = |i: &Value| i["objective"].as_f64().unwrap();
    assert!(iterations.len() > 3);
    assert!(
        iterations
            .windows(2)
            .all(|two| objective(&two[1]) >= objective(&two[0]) - 1e-6)
    );
    // The start belief, and a row for each action and state of T and of Z.
    assert_eq!(document["rows"].as_array().unwrap().len(), 1 + 4 + 4);
    for row in document["rows"].as_array().unwrap() {
        assert!(row["data_share"].as_f64().unwrap() > 0.9);
    }
    let learned = Pomdp::parse(&fs::read_to_string(&out).unwrap()).unwrap();
    let (truth_model, hand_model) = (
        Pomdp::parse(LAMP).unwrap(),
        fs::read_to_string(&hand).unwrap(),
    );
    let hand_model = Pomdp::parse(&hand_model).unwrap();
    let p = |m: &Pomdp| m.successors(1, 1)[0].1;
    let error = |m: &Pomdp| (p(m) - p(&truth_model)).abs();
    assert!(error(&learned) < 0.06 && error(&learned) < 0.3 * error(&hand_model));
    assert_eq!(document["hash"], format!("{:016x}", learned.hash()));
    let mean = |key: &str| document[key]["mean"].as_f64().unwrap();
    assert!((mean("predicted") / mean("measured") - 1.0).abs() < 0.03);
    assert!((mean("logged_predicted") / mean("logged_measured") - 1.0).abs() < 0.03);

    says_so(&done(&learn));
}

fn says_so(table: &str) {
    for part in [
        "log-likelihood",
        "share of data",
        "measured in the world",
        "T     press",
    ] {
        assert!(table.contains(part), "{part}: {table}");
    }
}

#[test]
fn a_model_that_predicts_wrongly_is_refused_and_not_written() {
    let folder = Folder::new();
    let truth = folder.write("truth.pomdp", LAMP);
    let (log, out) = (folder.path("missions.jsonl"), folder.path("learned.pomdp"));
    let options = ["--policy", "random", "--episodes", "30", "--out", &log];
    done(&[&["pomdp", "simulate", &truth][..], &options].concat());
    // By hand: the lamp goes out for good. So strong a prior cannot be talked out of it.
    let hand = LAMP.replace("0.9 0.1\n0.6 0.4", "0.1 0.9\n0.1 0.9");
    let hand = folder.write("hand.pomdp", &hand);
    let learn = ["pomdp", "learn", &hand, "--missions", &log, "--out", &out];
    let stubborn = [&learn[..], &["--prior-strength", "1e7"]].concat();
    let message = refused(&stubborn, 1);
    assert!(
        message.starts_with("not to be deployed: the model predicts"),
        "{message}"
    );
    assert!(message.contains("allowed are 20 %") && !Path::new(&out).exists());
    let json = run(&[&stubborn[..], &["--json"]].concat());
    let document: Value = serde_json::from_slice(&json.stdout).unwrap();
    assert_eq!(document["refused"].as_str().unwrap(), message.trim_end());
    // What was there before stays, and is not taken for the new one.
    fs::write(&out, "older").unwrap();
    let message = refused(&stubborn, 1);
    let last = message.lines().last().unwrap();
    assert_eq!(last, format!("{out} is older and was left as it was"));
    assert_eq!(fs::read_to_string(&out).unwrap(), "older");
    fs::remove_file(&out).unwrap();
    // Without rewards there is nothing to check by.
    let text = fs::read_to_string(&log).unwrap();
    let mut lines: Vec<Value> = text
        .lines()
        .map(|l| serde_json::from_str(l).unwrap())
        .collect();
    for line in &mut lines {
        line.as_object_mut().unwrap().remove("rewards");
    }
    let lines: Vec<String> = lines.iter().map(Value::to_string).collect();
    let silent = folder.write("silent.jsonl", &lines.join("\n"));
    let learn = [
        "pomdp",
        "learn",
        &truth,
        "--missions",
        &silent,
        "--out",
        &out,
    ];
    let message = refused(&learn, 1);
    assert!(message.contains("nothing to check the model by") && !Path::new(&out).exists());
    let told = done(&[&learn[..], &["--unchecked"]].concat());
    assert!(told.contains("not checked: ") && Path::new(&out).exists());
}

#[test]
fn chance_does_not_count_against_a_model_and_a_weak_check_is_called_so() {
    let folder = Folder::new();
    // Luck decides: a mission brings about 10 or about -10, nothing on average.
    let coin = "discount: 0.9 values: reward states: win lose actions: go observations: none
        T: go identity O: * uniform R: go : win : * : * 1 R: go : lose : * : * -1";
    let coin = folder.write("coin.pomdp", coin);
    let (log, out) = (folder.path("missions.jsonl"), folder.path("learned.pomdp"));
    let simulate = [
        "pomdp", "simulate", &coin, "--policy", "random", "--out", &log,
    ];
    let learn = ["pomdp", "learn", &coin, "--missions", &log, "--out", &out];
    for seed in ["1", "2", "3", "4", "5"] {
        done(&[&simulate[..], &["--episodes", "15", "--seed", seed]].concat());
        let json = done(&[&learn[..], &["--json", "--policy", "qmdp"]].concat());
        let document: Value = serde_json::from_str(&json).unwrap();
        assert_eq!(document["is_weakly_checked"], true);
        let mean = |key: &str| document[key]["mean"].as_f64().unwrap();
        let (predicted, measured) = (mean("logged_predicted"), mean("logged_measured"));
        assert!(
            (predicted - measured).abs() > 0.2 * measured.abs(),
            "{json}"
        );
        assert!(Path::new(&out).exists());
    }
    assert!(done(&learn).contains("a weak check"));
}

#[test]
fn what_is_simulated_and_compared_with_the_same_seed_shares_no_chance() {
    let folder = Folder::new();
    let log = folder.path("missions.jsonl");
    let options = ["--episodes", "2", "--seed", "4"];
    let simulate = [
        "pomdp", "simulate", MODEL, "--policy", "random", "--out", &log,
    ];
    done(&[&simulate[..], &options].concat());
    let text = fs::read_to_string(&log).unwrap();
    let discounted = |line: &str| -> f64 {
        let mission: Value = serde_json::from_str(line).unwrap();
        let rewards = mission["rewards"].as_array().unwrap().iter().rev();
        rewards.fold(0.0, |sum, r| r.as_f64().unwrap() + 0.95 * sum)
    };
    let simulated = text.lines().skip(1).map(discounted).sum::<f64>() / 2.0;
    let compare = ["pomdp", "compare", MODEL, "--policies", "random", "--json"];
    let json = done(&[&compare[..], &options].concat());
    let document: Value = serde_json::from_str(&json).unwrap();
    assert_eq!(document["discount"], 0.95);
    let compared = document["rows"][0]["mean"].as_f64().unwrap();
    assert!(simulated.is_finite() && (simulated - compared).abs() > 1e-6);
}

#[test]
fn wrong_missions_are_refused_with_file_and_line() {
    let folder = Folder::new();
    let truth = folder.write("truth.pomdp", LAMP);
    let head = "{\"format\":\"vigil-missions\",\"version\":1}\n";
    let of = |text: &str| {
        let log = folder.write("bad.jsonl", text);
        let out = folder.path("never.pomdp");
        let message = refused(
            &["pomdp", "learn", &truth, "--missions", &log, "--out", &out],
            2,
        );
        assert!(!Path::new(&out).exists());
        message.replace(&log, "LOG").trim_end().to_owned()
    };
    let mission = |actions: &str, observations: &str| {
        of(&format!(
            "{head}{{\"actions\":[{actions}],\"observations\":[{observations}]}}\n"
        ))
    };
    assert!(mission("\"press\"", "").starts_with("LOG:2: observations: 0 entries"));
    assert!(mission("\"kick\"", "\"dark\"").starts_with("LOG:2: 'kick' is no action"));
    assert_eq!(
        of("{\"format\":\"other\",\"version\":1}\n"),
        "LOG:1: format other 1, allowed is vigil-missions 1"
    );
    assert!(of(head).starts_with("LOG: no recorded step"));
    assert!(of("").starts_with("LOG:1: "));
    assert!(of(&format!("{head}[1,2]\n")).starts_with("LOG:2: "));
}

fn drawn(folder: &Folder, name: &str, arguments: &[&str]) -> String {
    let out = folder.path(name);
    done(&[&["pomdp", "picture"], arguments, &["--out", &out]].concat());
    fs::read_to_string(out).unwrap()
}

#[test]
fn policies_and_beliefs_are_drawn() {
    let folder = Folder::new();
    let lamp = folder.write("lamp.pomdp", LAMP);
    let words = |svg: &str| -> Vec<String> {
        let document = roxmltree::Document::parse(svg).unwrap();
        let texts = document.descendants().filter(|n| n.is_text());
        texts
            .map(|n| n.text().unwrap_or("").trim().to_owned())
            .collect()
    };
    let steps = "FP:EPM,GO:none,NP:ALT,FP:none";
    let belief = drawn(&folder, "belief.svg", &[MODEL, "--belief", steps]);
    for word in ["EPM", "GO", "ALT", "NOM", "NNP", "start"] {
        assert!(words(&belief).iter().any(|w| w == word), "{word}");
    }
    let areas = |svg: &str| svg.matches("<polygon").count();
    // Seven states, and a legend for those that matter.
    assert!(areas(&belief) >= 7 + 3);
    let graph = drawn(
        &folder,
        "graph.svg",
        &[MODEL, "--graph", "--policy", "qmdp"],
    );
    assert!(words(&graph).iter().any(|w| w == "FP"));
    // A box for each node, and at least one edge into each but the first.
    let boxes = graph.matches("<rect").count();
    assert!(boxes == 8 && graph.matches("<path").count() >= 7, "{graph}");
    let dot = drawn(&folder, "graph.dot", &[MODEL, "--graph", "--nodes", "5"]);
    assert!(dot.starts_with("digraph policy {") && dot.contains("n0 -> ") && dot.ends_with("}\n"));
    assert_eq!(
        dot.matches(" [label=\"").count() - dot.matches(" -> ").count(),
        5
    );
    let regions = drawn(&folder, "regions.svg", &[&lamp, "--regions"]);
    assert!(words(&regions).iter().any(|w| w == "press") && areas(&regions) >= 3);
    let three = "discount: 0.9 values: reward states: 3 actions: 3 observations: 2
        T: * identity O: * uniform R: 0 : 0 : * : * 1 R: 1 : 1 : * : * 1 R: 2 : 2 : * : * 1";
    let three = folder.write("three.pomdp", three);
    let triangle = drawn(
        &folder,
        "triangle.svg",
        &[&three, "--regions", "--policy", "qmdp"],
    );
    // Cells, the start's mark, a legend of three actions.
    assert_eq!(areas(&triangle), 120 * 120 + 1 + 3);
    solved_ones_are_drawn(&folder, &lamp);
    let out = folder.path("no.svg");
    let message = refused(&["pomdp", "picture", MODEL, "--regions", "--out", &out], 2);
    assert_eq!(
        message,
        "--regions: a model of 7 states; allowed are 2 and 3\n"
    );
    let message = refused(
        &[
            "pomdp", "picture", MODEL, "--graph", "--policy", "nosuch", "--out", &out,
        ],
        2,
    );
    assert!(message.contains("allowed are mls, av"), "{message}");
    refused(&["pomdp", "picture", MODEL, "--out", &out], 2);
    assert!(!Path::new(&out).exists());
}

/// By a policy of a format that does not name its model: with a warning.
fn solved_ones_are_drawn(folder: &Folder, lamp: &str) {
    let policy = folder.path("lamp.policy");
    done(&[
        "pomdp", "solve", lamp, "--method", "sarsop", "--out", &policy,
    ]);
    let point = folder.path("point.svg");
    let picture = ["pomdp", "picture", lamp, "--graph", "--policy", &policy];
    let output = run(&[&picture[..], &["--out", &point]].concat());
    let warning = String::from_utf8(output.stderr).unwrap();
    assert!(output.status.success() && Path::new(&point).exists());
    assert!(
        warning.contains("warning: this format does not say which model"),
        "{warning}"
    );
}
