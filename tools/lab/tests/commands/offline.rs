//! The offline commands as a user runs them: `learn`, `evaluate`, `diagnose`.

use std::fs;
use std::path::Path;
use std::process::{Command, Output, Stdio};

use serde_json::Value;
use tempfile::TempDir;

use super::workplace::{cut, root};

const FRAMES: &str = "tests/data/rover/learn_frames.csv.gz";
const MODEL: &str = "config/models/rover.toml";
const RUNS: &str = "tests/data/rover/learn_runs.csv";

fn vigil(arguments: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_vigil-lab"));
    command.args(arguments).current_dir(root());
    command
}

fn run(arguments: &[&str]) -> Output {
    vigil(arguments).output().unwrap()
}

fn json(arguments: &[&str]) -> Value {
    let output = run(arguments);
    let errors = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(output.status.success(), "{errors}");
    assert_eq!(errors, "", "nothing but the document is printed");
    serde_json::from_slice(&output.stdout).unwrap()
}

/// A model learned from the shipped runs, its file and the folder that holds it.
fn learned() -> (TempDir, String, Value) {
    let folder = TempDir::new().unwrap();
    let model = folder.path().join("rover.toml").display().to_string();
    let report = json(&[
        "learn", "--frames", FRAMES, "--runs", RUNS, "--out", &model, "--json",
    ]);
    (folder, model, report)
}

/// How many times the sensor's noise a residual may be: a tenth more than it. The yaw of a rover
/// whose right middle wheel is stuck falls short of that, with 1.11.
fn largest_to_floor(mode: &Value, key: &str) -> f64 {
    match (mode["mode"].as_str().unwrap(), key) {
        ("RM_STUCK", "yaw") => 1.12,
        _ => 1.1,
    }
}

fn check_report(report: &Value) {
    let modes = report["modes"].as_array().unwrap();
    assert_eq!(modes.len(), 7);
    for mode in modes {
        // No better than the sensor's noise, and as much worse as the model itself predicts.
        for key in ["position", "yaw"] {
            let of = |name: &str| mode[key][name].as_f64().unwrap();
            let (ratio, error) = (of("to_floor"), of("to_floor_error"));
            assert_eq!(mode[format!("{key}_to_floor")], ratio);
            assert!(
                (0.95..largest_to_floor(mode, key)).contains(&ratio),
                "{mode}"
            );
            let apart = ratio - of("predicted_to_floor");
            assert!(error < 0.03 && apart.abs() < 0.03, "{mode}");
        }
        for turn in ["yaw_left", "yaw_right"] {
            assert!(mode[turn]["to_floor"].as_f64().unwrap() > 0.95, "{mode}");
        }
    }
    let held_out = report["held_out_run_ids"].as_array().unwrap().len();
    assert_eq!(report["runs_held_out"], held_out);
    assert_eq!(report["runs_learned"], 492 - held_out);
    assert!((150..175).contains(&held_out));
}

fn check_score(score: &Value, held_out: usize) {
    let runs = score["runs"].as_object().unwrap().values();
    let runs: u64 = runs.map(|n| n.as_u64().unwrap()).sum();
    assert_eq!(
        runs, held_out as u64,
        "every run left out, and no other, is scored"
    );
    assert_eq!(score["false_alarms"]["alarms"], 0);
    for class in ["stuck", "zero", "frozen", "noise"] {
        assert_eq!(score["detection"][class]["missed"], 0, "{class}");
    }
    let leaf = &score["identification"]["all"]["leaf"];
    for instant in ["after_2_s", "after_5_s", "after_10_s", "at_end"] {
        assert!(
            leaf[instant]["fraction"].as_f64().unwrap() >= 0.97,
            "{instant}: {leaf}"
        );
    }
}

#[test]
fn a_learned_model_names_the_faults_of_runs_left_out() {
    let (folder, model, report) = learned();
    check_report(&report);
    let entries = fs::read_dir(folder.path()).unwrap().count();
    assert_eq!(entries, 1, "only the model is left behind");
    let held_out: Vec<u32> = serde_json::from_value(report["held_out_run_ids"].clone()).unwrap();
    let on = |frames| {
        let of = ["evaluate", "--model", &model, "--frames", frames];
        [&of[..], &["--runs", RUNS, "--json"]].concat()
    };
    check_score(&json(&on(FRAMES)), held_out.len());

    // Of the other ways to evaluate, a third of the runs tells enough.
    let third = folder.path().join("third.csv");
    cut(&root().join(FRAMES), &third, |run, _| run % 3 == 0);
    let third = third.display().to_string();
    let held_out_in_third = held_out.iter().filter(|run| *run % 3 == 0).count();
    let evaluate = on(&third);
    let score = json(&evaluate);
    check_score(&score, held_out_in_third);
    assert_eq!(
        json(&evaluate),
        score,
        "the same seed gives the same figures"
    );

    let pose = json(&[&evaluate[..], &["--sensors", "pose"]].concat());
    assert_eq!(pose["false_alarms"]["alarms"], 0);
    let detected = pose["detection"]["stuck"]["detected"].as_f64().unwrap();
    assert!(detected >= 0.97 * pose["detection"]["stuck"]["n"].as_f64().unwrap());

    for form in ["constant", "windowed"] {
        let score = json(&[&evaluate[..], &["--detector", form]].concat());
        assert_eq!(score["detector"], form);
        check_score(&score, held_out_in_third);
    }

    // Not one run of this file was left out: a clear refusal, not an empty score.
    let frames = folder.path().join("few.csv");
    cut(&root().join(FRAMES), &frames, |run, _| {
        run < 9 && !held_out.contains(&run)
    });
    let few = frames.display().to_string();
    let refused = run(&[
        "evaluate", "--model", &model, "--frames", &few, "--runs", RUNS,
    ]);
    assert_eq!(refused.status.code(), Some(2));
    let message = String::from_utf8_lossy(&refused.stderr).into_owned();
    assert!(
        message.ends_with("score every run with --part all\n"),
        "{message}"
    );

    a_closed_pipe_is_success(&model, &few);
}

/// Rows of a run cut short equal the first rows of the whole run among others, for each set of
/// channels: cut before, at and after the onset of a fault, alone in its file or not.
#[test]
fn verdicts_are_causal() {
    let folder = TempDir::new().unwrap();
    // A nominal run, a stuck wheel and a frozen encoder; runs of this data last 15 s.
    let ids = [0, 100, 450];
    for sensors in ["pose", "pose+encoders"] {
        let diagnose = |name: &str, keep: &dyn Fn(u32, f64) -> bool| {
            let (frames, out) = (folder.path().join("in.csv"), folder.path().join(name));
            cut(&root().join(FRAMES), &frames, keep);
            let paths = [frames, out.clone()].map(|path| path.display().to_string());
            let output = run(&[
                "diagnose",
                "--model",
                MODEL,
                "--frames",
                &paths[0],
                "--out",
                &paths[1],
                "--sensors",
                sensors,
            ]);
            assert!(output.status.success() && output.stdout.is_empty());
            assert_eq!(String::from_utf8_lossy(&output.stderr), "");
            fs::read_to_string(out).unwrap()
        };
        let whole = diagnose("whole.csv", &|run, _| ids.contains(&run));
        assert_eq!(whole.lines().count(), 1 + 3 * 300);
        let header = "run,t,p_fault,alarm,mode,p_mode,p_unknown,fault_set,p_left_stuck,\
                      p_right_stuck,reported,reason,action,size,size_kind,context";
        assert_eq!(whole.lines().next(), Some(header));
        assert!(whole.contains(",1,RM_STUCK,"), "something is diagnosed");
        // Runs, seconds, and frames of each run until then.
        let cuts: [(&[u32], f64, usize); 6] = [
            (&ids, 0.07, 1),
            (&ids, 1.52, 30),
            (&ids, 4.52, 90),
            (&ids[1..], 5.03, 100),
            (&[100], 7.0, 139),
            (&[450], 11.0, 219),
        ];
        for (kept, until_s, frames) in cuts {
            let short = diagnose("short.csv", &|run, t_s| {
                kept.contains(&run) && t_s < until_s
            });
            let is_kept = |line: &&str| {
                let fields: Vec<&str> = line.split(',').collect();
                kept.contains(&fields[0].parse().unwrap())
                    && fields[1].parse::<f64>().unwrap() < until_s
            };
            let wanted: Vec<&str> = whole.lines().skip(1).filter(is_kept).collect();
            assert_eq!(wanted.len(), kept.len() * frames);
            assert_eq!(short.lines().skip(1).collect::<Vec<_>>(), wanted);
        }
    }
}

fn a_closed_pipe_is_success(model: &str, frames: &str) {
    let mut child = vigil(&[
        "evaluate", "--model", model, "--frames", frames, "--runs", RUNS,
    ])
    .args(["--part", "all"])
    .stdout(Stdio::piped())
    .stderr(Stdio::piped())
    .spawn()
    .unwrap();
    drop(child.stdout.take());
    let output = child.wait_with_output().unwrap();
    assert_eq!(output.status.code(), Some(0));
    assert_eq!(String::from_utf8_lossy(&output.stderr), "");
}

#[test]
fn wrong_input_is_refused_with_its_name_and_exit_code_2() {
    let folder = TempDir::new().unwrap();
    let path = |name: &str| folder.path().join(name).display().to_string();
    let (no_pose, model, out) = (path("frames.csv"), path("model.toml"), path("out"));
    fs::write(&no_pose, "run,t\n").unwrap();
    fs::write(&model, "version = 1\n").unwrap();
    let learn = ["learn", "--runs", RUNS, "--out", &out];
    let diagnose = ["diagnose", "--frames", FRAMES, "--out", &out];
    let cases: [(Vec<&str>, &str); 9] = [
        (
            [&learn[..], &["--frames", "no.csv"]].concat(),
            "no.csv: No such file",
        ),
        (
            [&learn[..], &["--frames", &no_pose]].concat(),
            "frames.csv: missing columns cmd_curv, cmd_speed, x, y, yaw",
        ),
        (
            [&learn[..], &["--frames", FRAMES, "--test-fraction", "1"]].concat(),
            "allowed is 0 to 0.9",
        ),
        (
            [&learn[..], &["--frames", FRAMES, "--robot", "no.toml"]].concat(),
            "no.toml: cannot be read",
        ),
        (
            [&diagnose[..], &["--model", "no.toml"]].concat(),
            "no.toml: No such file",
        ),
        (
            [&diagnose[..], &["--model", &model]].concat(),
            "model.toml: the model has layout version 1; this program reads version 4: learn it",
        ),
        (
            [&diagnose[..], &["--model", &model, "--sensors", "lidar"]].concat(),
            "pose+encoders",
        ),
        (
            [&diagnose[..], &["--model", &model, "--detector", "chi2"]].concat(),
            "learned-bias, constant, windowed",
        ),
        (
            [&diagnose[..], &["--model", &model, "--particles", "31"]].concat(),
            "32..=1024",
        ),
    ];
    for (arguments, wanted) in cases {
        let output = run(&arguments);
        let message = String::from_utf8_lossy(&output.stderr).into_owned();
        assert_eq!(output.status.code(), Some(2), "{arguments:?}: {message}");
        assert!(message.contains(wanted), "{arguments:?}: {message}");
        assert!(output.stdout.is_empty() && !Path::new(&out).exists());
    }
}
