//! `vigil pomdp compare` and `vigil pomdp generate` as a user sees them.

use std::fs;
use std::process::{Command, Output};

use serde_json::Value;
use tempfile::TempDir;

use super::workplace::root;

const MODEL: &str = "config/navigation.pomdp";

fn run(arguments: &[&str]) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_vigil-lab"));
    let command = command.args(arguments).current_dir(root());
    command.output().unwrap()
}

fn text(arguments: &[&str]) -> String {
    let output = run(arguments);
    let errors = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(output.status.success() && errors.is_empty(), "{errors}");
    String::from_utf8(output.stdout).unwrap()
}

/// As [`text`], for commands that tell how far they are.
fn text_and_progress(arguments: &[&str]) -> String {
    let output = run(arguments);
    let errors = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(output.status.success(), "{errors}");
    String::from_utf8(output.stdout).unwrap()
}

fn compare(options: &[&str]) -> Value {
    let all = [&["pomdp", "compare", MODEL, "--json"], options].concat();
    serde_json::from_str(&text(&all)).unwrap()
}

fn refused(arguments: &[&str]) -> String {
    let output = run(&[&["pomdp"], arguments].concat());
    assert_eq!(output.status.code(), Some(2));
    assert!(output.stdout.is_empty());
    String::from_utf8(output.stderr).unwrap()
}

/// Everything but times, which no two runs share.
fn without_times(document: &Value) -> Value {
    let mut document = document.clone();
    for row in document["rows"].as_array_mut().unwrap() {
        let row = row.as_object_mut().unwrap();
        row.retain(|key, _| !key.ends_with("_ns"));
    }
    document
}

#[test]
fn policies_and_thresholds_are_the_rows_and_the_escalation_is_beaten() {
    let options = [
        "--policies",
        "escalation-1,qmdp,fib,dm-av,random",
        "--thresholds",
        ".2,.8",
        "--episodes",
        "300",
        "--information-actions",
        "FP,NP,RL,GO,MA",
        "--seed",
        "5",
    ];
    let document = compare(&options);
    let rows = document["rows"].as_array().unwrap();
    let names: Vec<&str> = rows.iter().map(|r| r["policy"].as_str().unwrap()).collect();
    assert_eq!(
        names,
        ["escalation-1", "qmdp", "fib", "dm-av", "dm-av", "random"]
    );
    let thresholds: Vec<Option<f64>> = rows.iter().map(|r| r["threshold"].as_f64()).collect();
    assert_eq!(thresholds, [None, None, None, Some(0.2), Some(0.8), None]);
    assert_eq!(document["against"]["policy"], "escalation-1");
    assert_eq!(
        (&document["steps_max"], &document["episodes"]),
        (&180.into(), &300.into())
    );
    let number = |row: &Value, key: &str| row[key].as_f64().unwrap();
    let upper = number(&document, "upper");
    // The fast informed bound is 16.37; what is earned, 15.8.
    assert!(upper > 15.7 && upper < 15.95, "{upper}");
    assert_eq!(document["upper_from"], "point-based solver");
    for row in rows {
        let (mean, half) = (number(row, "mean"), number(row, "half_width_95"));
        assert!((number(row, "regret") - (upper - mean)).abs() < 1e-9);
        assert!(mean < upper + half, "{row}");
        assert!(number(row, "worst_5_percent") < number(row, "median"));
        assert_eq!(number(row, "impossible"), 0.0);
        assert!(number(row, "decision_p50_ns") <= number(row, "decision_p99_ns"));
        let difference = number(row, "mean") - number(&rows[0], "mean");
        assert!((number(row, "difference") - difference).abs() < 1e-9);
    }
    for row in &rows[1..5] {
        assert!(
            number(row, "difference") > 0.0 && number(row, "difference_p") < 1e-3,
            "{row}"
        );
    }
    assert!(number(&rows[3], "dual_share") > number(&rows[4], "dual_share"));
    assert_eq!(rows.iter().filter(|r| r["is_best"] == true).count(), 1);
    // The same again, to the bit; other missions with another seed.
    assert_eq!(without_times(&compare(&options)), without_times(&document));
    let other = compare(&[&options[..9], &["6"]].concat());
    assert_ne!(other["rows"][1]["mean"], rows[1]["mean"]);
    // Where calls for help may be made to know more, they are, and cost more than they teach.
    let all = compare(&[&options[..6], &options[8..]].concat());
    assert!(number(&all["rows"][3], "mean") < number(&rows[3], "mean") - 10.0);
}

#[test]
fn the_table_marks_the_best_and_says_what_it_is_about() {
    let table = text(&[
        "pomdp",
        "compare",
        MODEL,
        "--policies",
        "qmdp,random",
        "--episodes",
        "50",
    ]);
    for wanted in [
        "50 missions each, seed 1, 180 steps",
        " (point-based solver); differences are to",
        "differences are to qmdp",
        "\n* qmdp",
        "\n  random",
    ] {
        assert!(table.contains(wanted), "{wanted}: {table}");
    }
}

#[test]
fn missions_that_actions_end_have_no_regret_and_dual_control_does_not_end_them() {
    let options = [
        "--policies",
        "dm-qmdp,random",
        "--episodes",
        "100",
        "--ends",
        "SH,GU",
    ];
    let document = compare(&options);
    assert!(document["upper"].is_null() && document["upper_from"].is_null());
    let kept: Vec<&str> = document["information_actions"]
        .as_array()
        .unwrap()
        .iter()
        .map(|a| a.as_str().unwrap())
        .collect();
    assert_eq!(kept, ["FP", "NP", "RL", "GO", "MA"]);
    let random = &document["rows"][1];
    assert!(random["regret"].is_null() && random["ended_share"] == 1.0);
    let steps = random["steps_mean"].as_f64().unwrap();
    assert!(
        (2.0..6.0).contains(&steps),
        "two actions in seven end it: {steps}"
    );
}

#[test]
fn a_wrong_model_costs_what_simulating_the_right_one_shows() {
    let folder = TempDir::new().unwrap();
    let worse = folder.path().join("worse.toml");
    let model = folder.path().join("worse.pomdp");
    let parameters = fs::read_to_string(root().join("config/navigation.toml")).unwrap();
    // Openings hardly ever help, new paths only at times.
    let changed = parameters
        .replace(
            "go = { pp = 0.9, rt = 0.7, nnp = 0.1 }",
            "go = { pp = 0.1, rt = 0.1 }",
        )
        .replace("hp = 0.0005", "hp = 0.01");
    assert_ne!(changed, parameters);
    fs::write(&worse, changed).unwrap();
    let (worse, model) = (worse.to_str().unwrap(), model.to_str().unwrap());
    text(&["pomdp", "generate", worse, "--out", model]);
    let options = ["--policies", "qmdp", "--episodes", "400"];
    let wrong = compare(&[&options[..], &["--model-error", model]].concat());
    let right = [&["pomdp", "compare", model, "--json"], &options[..]].concat();
    let right: Value = serde_json::from_str(&text(&right)).unwrap();
    assert_ne!(wrong["model_hash"], wrong["world_hash"]);
    assert_eq!(wrong["world_hash"], right["world_hash"]);
    assert_eq!(wrong["upper"], right["upper"]);
    let mean = |document: &Value| document["rows"][0]["mean"].as_f64().unwrap();
    let half = right["rows"][0]["half_width_95"].as_f64().unwrap();
    assert!(
        mean(&wrong) < mean(&right) - half,
        "{} {}",
        mean(&wrong),
        mean(&right)
    );
}

#[test]
fn the_shipped_model_is_what_the_command_generates() {
    let generated = text(&["pomdp", "generate", "config/navigation.toml"]);
    let shipped = run(&[
        "pomdp",
        "compare",
        MODEL,
        "--episodes",
        "2",
        "--policies",
        "av",
    ]);
    assert!(shipped.status.success());
    assert!(generated == fs::read_to_string(root().join(MODEL)).unwrap());
}

#[test]
fn a_solved_policy_takes_part_and_is_recorded() {
    let folder = TempDir::new().unwrap();
    let path = |name: &str| folder.path().join(name).to_str().unwrap().to_owned();
    let policy = path("policy.json");
    text_and_progress(&[
        "pomdp",
        "solve",
        MODEL,
        "--precision",
        "0.3",
        "--out",
        &policy,
    ]);
    let options = [
        "--policies",
        "escalation-1,mls,point-based",
        "--policy-file",
        &policy,
        "--episodes",
        "300",
    ];
    let document = compare(&options);
    let rows = document["rows"].as_array().unwrap();
    let row = |name: &str| rows.iter().find(|row| row["policy"] == name).unwrap();
    let mean = |name: &str| row(name)["mean"].as_f64().unwrap();
    assert!(mean("point-based") > mean("escalation-1"));
    assert!(row("point-based")["difference_p"].as_f64().unwrap() < 1e-3);
    let missions = path("missions.jsonl");
    let simulate = ["pomdp", "simulate", MODEL, "--policy", "point-based"];
    let given = [
        "--policy-file",
        &policy,
        "--episodes",
        "5",
        "--out",
        &missions,
    ];
    text_and_progress(&[&simulate[..], &given].concat());
    let recorded = fs::read_to_string(&missions).unwrap();
    assert_eq!(recorded.lines().count(), 6);
    assert!(
        recorded.starts_with("{\"format\":\"vigil-missions\",\"version\":1,\"policy\":\"point")
    );
    let other = ["simulate", "config/rover.pomdp", "--policy", "point-based"];
    let message = refused(&[&other[..], &given].concat());
    assert!(message.contains("solved for the model"), "{message}");
}

#[test]
fn options_that_mean_nothing_are_refused_with_what_is_allowed() {
    let with = |options: &[&str]| refused(&[&["compare", MODEL], options].concat());
    let cases: [(&[&str], &str); 13] = [
        (
            &["--policies", "point-based"],
            "point-based: requires --policy-file",
        ),
        (
            &["--policy-file", "config/rover.toml"],
            "--policy-file: has a meaning only with the policies point-based and despot",
        ),
        (
            &["--policies", "point-based", "--policy-file", "config/none"],
            "--policy-file config/none: No such file",
        ),
        (
            &["--policies", "luck"],
            "'luck' is not known: allowed are mls, av, qmdp, fib",
        ),
        (&["--policies", "qmdp,qmdp"], "'qmdp' appears twice"),
        (&["--policies", "escalation-0"], "escalation-N, N from 1"),
        (
            &["--thresholds", "1.5"],
            "1.5 is out of range: allowed is 0 to 1",
        ),
        (&["--ends", "STOP"], "no action 'STOP'; allowed are FP, NP"),
        (&["--information-actions", "XX"], "no action 'XX'"),
        (
            &["--against", "fib", "--policies", "qmdp"],
            "allowed are qmdp",
        ),
        (&["--episodes", "1"], "1 is not in 2..=10000000"),
        (
            &["--model-error", "config/rover.pomdp"],
            "its states differ",
        ),
        (
            &["--policies", "escalation-2", "--quiet", "hush"],
            "no observation 'hush'",
        ),
    ];
    for (options, part) in cases {
        let message = with(options);
        assert!(message.contains(part), "{part}: {message}");
    }
    assert!(refused(&["compare", "config/none.pomdp"]).contains("No such file"));
    assert!(refused(&["generate", "config/rover.toml"]).contains("missing field `model`"));
}
