//! `vigil pomdp info | track | convert` as a user runs them.

use std::fs;
use std::process::{Command, Output};

use serde_json::Value;
use tempfile::TempDir;

use super::workplace::{data, root};

const TIGER: &str = "discount: 0.95\nvalues: reward\nstates: left right\n\
    actions: listen open-left open-right\nobservations: hear-left hear-right\n\
    T: listen identity\nT: open-left uniform\nT: open-right uniform\n\
    O: listen 0.85 0.15 0.15 0.85\nO: open-left uniform\nO: open-right uniform\n\
    R: listen : * : * : * -1\nR: open-left : left : * : * -100\n\
    R: open-left : right : * : * 10\nR: open-right : left : * : * 10\n\
    R: open-right : right : * : * -100\n";

fn vigil(arguments: &[&str]) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_vigil-lab"));
    let command = command.arg("pomdp").args(arguments).current_dir(root());
    command.output().unwrap()
}

fn text(output: &[u8]) -> String {
    String::from_utf8(output.to_vec()).unwrap()
}

fn document(output: &Output) -> Value {
    serde_json::from_slice(&output.stdout).unwrap()
}

fn write(folder: &TempDir, name: &str, content: &str) -> String {
    let path = folder.path().join(name);
    fs::write(&path, content).unwrap();
    path.display().to_string()
}

fn numbers(value: &Value) -> Vec<f64> {
    let all = value.as_array().unwrap().iter();
    all.map(|number| number.as_f64().unwrap()).collect()
}

#[test]
fn the_belief_is_followed_by_names_and_by_numbers() {
    let folder = TempDir::new().unwrap();
    let tiger = write(&folder, "tiger.pomdp", TIGER);
    let arguments = [
        "track",
        &tiger,
        "--json",
        "--steps",
        "listen:hear-left, 0:0,open-left:1",
    ];
    let output = vigil(&arguments);
    assert_eq!(output.status.code(), Some(0));
    let document = document(&output);
    let steps = document["steps"].as_array().unwrap();
    assert_eq!(steps.len(), 3);
    assert_eq!(steps[0]["probability"], 0.5);
    assert!((numbers(&steps[0]["belief"])[0] - 0.85).abs() < 1e-15);
    assert!((steps[1]["probability"].as_f64().unwrap() - 0.745).abs() < 1e-15);
    assert!((numbers(&steps[1]["belief"])[0] - 0.969_798_657_718).abs() < 1e-12);
    assert_eq!(numbers(&steps[2]["belief"]), [0.5, 0.5]);
    let sum = 0.5_f64.ln() + 0.745_f64.ln() + 0.5_f64.ln();
    assert!((document["log_likelihood"].as_f64().unwrap() - sum).abs() < 1e-12);
    let shown = text(&vigil(&["track", &tiger, "--steps", "listen:hear-left"]).stdout);
    assert!(shown.contains("listen:hear-left           0.500000  left 0.850000  right 0.150000"));
    let none = vigil(&["track", &tiger, "--steps", "", "--json"]);
    assert_eq!(self::document(&none)["steps"], serde_json::json!([]));
}

#[test]
fn what_a_policy_does_at_each_belief_is_told() {
    let folder = TempDir::new().unwrap();
    let tiger = write(&folder, "tiger.pomdp", TIGER);
    let policy = folder.path().join("tiger.json");
    let policy = policy.to_str().unwrap();
    let solve = ["solve", &tiger, "--precision", "0.01", "--out", policy];
    assert_eq!(vigil(&solve).status.code(), Some(0));
    let steps = "listen:hear-left,listen:hear-left";
    let arguments = ["track", &tiger, "--steps", steps, "--policy-file", policy];
    // Tiger at .95: two more noises on one side than on the other, and the other door is opened.
    let shown = text(&vigil(&arguments).stdout);
    let actions: Vec<&str> = shown
        .lines()
        .filter_map(|line| line.split("-> ").nth(1)?.split(' ').next())
        .collect();
    assert_eq!(actions, ["listen", "listen", "open-right"]);
    let document = document(&vigil(&[&arguments[..], &["--json"]].concat()));
    let last = &document["steps"][1]["decision"];
    assert_eq!(last["action"], "open-right");
    let mut values = numbers(&last["values"]);
    values.sort_by(f64::total_cmp);
    let margin = last["margin"].as_f64().unwrap();
    assert!((values[2] - values[1] - margin).abs() < 1e-9 && margin > 0.0);
    let foreign = write(&folder, "other.pomdp", &TIGER.replace("0.95", "0.9"));
    let refused = vigil(&["track", &foreign, "--steps", "", "--policy-file", policy]);
    assert_eq!(refused.status.code(), Some(2));
    assert!(text(&refused.stderr).contains("--policy-file"));
}

#[test]
fn impossible_steps_are_told() {
    let folder = TempDir::new().unwrap();
    let sharp = TIGER.replace("0.85 0.15 0.15 0.85", "1 0 0 1");
    let tiger = write(&folder, "sharp.pomdp", &sharp);
    let arguments = [
        "track",
        &tiger,
        "--steps",
        "listen:hear-left,listen:hear-right",
    ];
    let output = vigil(&arguments);
    assert_eq!(output.status.code(), Some(1));
    assert!(text(&output.stdout).contains("IMPOSSIBLE"));
    let document = document(&vigil(&[&arguments[..], &["--json"]].concat()));
    assert_eq!(document["impossible_steps"], 1);
    assert_eq!(document["log_likelihood"], Value::Null);
    let step = &document["steps"][1];
    assert_eq!(
        (&step["impossible"], &step["probability"]),
        (&true.into(), &0.0.into())
    );
    // The prediction with 0.01 of the start belief.
    let belief = numbers(&step["belief"]);
    assert!((belief[0] - 0.995).abs() < 1e-15 && (belief[1] - 0.005).abs() < 1e-15);
}

#[test]
fn a_model_is_described() {
    let folder = TempDir::new().unwrap();
    let with_cellar = TIGER
        .replace(
            "states: left right",
            "states: left right cellar\nstart exclude: cellar",
        )
        .replace(
            "T: open-left uniform\nT: open-right uniform",
            "T: * : * : cellar 0\n\
            T: open-left : left 0.5 0.5 0 T: open-left : right 0.5 0.5 0\n\
            T: open-right : left 0.5 0.5 0 T: open-right : right 0.5 0.500004 0\n\
            T: * : cellar : cellar 1",
        )
        .replace("0.15 0.85\n", "0.15 0.85 0.5 0.5\n");
    // The start belief stands before the rules, not inside the preamble.
    let with_cellar = with_cellar.replace("\nstart exclude: cellar", "");
    let with_cellar = with_cellar.replace("T: listen", "start exclude: cellar\nT: listen");
    let tiger = write(&folder, "tiger.pomdp", &with_cellar);
    let output = vigil(&["info", &tiger, "--json"]);
    assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
    let document = document(&output);
    assert_eq!(document["states"].as_array().unwrap().len(), 3);
    assert_eq!(numbers(&document["start"]), [0.5, 0.5, 0.0]);
    assert_eq!(document["reachable_states"], 2);
    assert_eq!(document["unreachable"], serde_json::json!(["cellar"]));
    assert_eq!(document["observation"]["structure"], "noisy");
    assert_eq!(document["observation"]["depends_on_action"], true);
    assert_eq!(document["rewards_depend_on_outcome"], false);
    let warning = &document["warnings"][0];
    assert!(
        warning["message"]
            .as_str()
            .unwrap()
            .contains("T: open-right : right sums to 1.00000")
    );
    assert_eq!(document["hash"].as_str().unwrap().len(), 16);
    let shown = text(&vigil(&["info", &tiger]).stdout);
    for wanted in [
        "2 can be reached",
        "noisy",
        "warning: line 10",
        "values: reward",
    ] {
        assert!(shown.contains(wanted), "{wanted}: {shown}");
    }
}

#[test]
fn the_shipped_model_is_described() {
    let output = vigil(&["info", "config/rover.pomdp", "--json"]);
    assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
    let document = document(&output);
    assert_eq!(
        document["reachable_states"],
        document["states"].as_array().unwrap().len()
    );
    assert_eq!(document["warnings"], serde_json::json!([]));
}

#[test]
fn both_formats_are_converted_and_mean_the_same() {
    let folder = TempDir::new().unwrap();
    let hash = |path: &str| document(&vigil(&["info", path, "--json"]))["hash"].clone();
    let tiger = write(&folder, "tiger.pomdp", TIGER);
    let out = folder.path().join("again.pomdp").display().to_string();
    let output = vigil(&["convert", &tiger, "--out", &out, "--json"]);
    assert_eq!(output.status.code(), Some(0));
    assert_eq!(document(&output)["hash"], hash(&tiger));
    assert_eq!(hash(&out), hash(&tiger));
    let printed = vigil(&["convert", &tiger]);
    assert_eq!(printed.stdout, fs::read(&out).unwrap());

    let entry = |instance: &str, name: &str, numbers: &str| {
        format!("<Entry><Instance>{instance}</Instance><{name}>{numbers}</{name}></Entry>")
    };
    let given = |tag: &str, variable: &str, parents: &str, entries: String| {
        format!(
            "<{tag}><Var>{variable}</Var><Parent>{parents}</Parent><Parameter type=\"TBL\">\
             {entries}</Parameter></{tag}>"
        )
    };
    let coin = format!(
        "<pomdpx version=\"0.1\"><Discount>0.5</Discount><Variable><StateVar vnamePrev=\"s\" \
         vnameCurr=\"t\"><NumValues>2</NumValues></StateVar><ActionVar vname=\"a\"><ValueEnum>\
         reset</ValueEnum></ActionVar><RewardVar vname=\"r\"/></Variable><InitialStateBelief>{}\
         </InitialStateBelief><StateTransitionFunction>{}</StateTransitionFunction>\
         <RewardFunction>{}</RewardFunction></pomdpx>",
        given("CondProb", "s", "null", entry("-", "ProbTable", "uniform")),
        given(
            "CondProb",
            "t",
            "a s",
            entry("* - -", "ProbTable", "identity")
        ),
        given("Func", "r", "s", entry("s1", "ValueTable", "2.5")),
    );
    let coin = write(&folder, "coin.pomdpx", &coin);
    let output = vigil(&["convert", &coin]);
    assert_eq!(
        text(&output.stdout),
        "discount: 0.5\nvalues: reward\nstates: s0 s1\nactions: reset_\n\nstart: uniform\n\n\
         T: * identity\n\nR: * : s1 : * 2.5\n"
    );
    assert!(text(&output.stderr).contains("'reset' is called 'reset_'"));
}

#[test]
fn what_is_wrong_is_told_with_its_place() {
    let folder = TempDir::new().unwrap();
    let tiger = write(&folder, "tiger.pomdp", TIGER);
    let broken = write(
        &folder,
        "broken.pomdp",
        &TIGER.replace("T: listen", "T: lissen"),
    );
    let xml = write(&folder, "broken.pomdpx", "<pomdpx></pomdp>");
    let out = folder.path().join("x.pomdpx").display().to_string();
    let cases: [(&[&str], &str); 8] = [
        (
            &["info", &broken],
            "broken.pomdp: line 6, column 4: 'lissen', wanted is a",
        ),
        (&["info", &xml], "broken.pomdpx: line 1, column"),
        (&["info", "missing.pomdp"], "missing.pomdp: "),
        (
            &["convert", &tiger, "--out", &out],
            ".pomdpx is read, not written",
        ),
        (
            &["track", &tiger, "--steps", "listen"],
            "step 1: 'listen', wanted is ACTION:OBS",
        ),
        (
            &["track", &tiger, "--steps", "0:0,jump:0"],
            "step 2: 'jump' is no action, allowed are",
        ),
        (
            &["track", &tiger, "--steps", "0:2"],
            "'2' is no observation",
        ),
        (&["track", &tiger], "--steps"),
    ];
    for (arguments, part) in cases {
        let output = vigil(arguments);
        let errors = text(&output.stderr);
        assert_eq!(output.status.code(), Some(2), "{errors}");
        assert!(
            output.stdout.is_empty() && errors.contains(part),
            "{part}: {errors}"
        );
    }
}

/// Beliefs of public models that were worked out elsewhere.
#[test]
fn public_models_are_followed_as_published() {
    let Some(data) = data() else {
        return;
    };
    let cases = [
        ("network", "unrestrict:up", 0.443, None),
        ("network", "steady:down", 0.142_257_336_343, None),
        (
            "network",
            "reboot:up",
            1.0,
            Some(vec![1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]),
        ),
        (
            "web-ad",
            "AN:O1",
            0.316_666_666_667,
            Some(vec![
                0.684_210_526_316,
                0.105_263_157_895,
                0.210_526_315_789,
                0.0,
            ]),
        ),
    ];
    for (name, steps, probability, belief) in cases {
        let path = data.join(format!("pomdp/{name}.pomdp"));
        let path = path.display().to_string();
        // The values of network are those of successive steps.
        let all = match steps {
            "steady:down" => "unrestrict:up,steady:down",
            "reboot:up" => "unrestrict:up,steady:down,reboot:up",
            one => one,
        };
        let output = vigil(&["track", &path, "--steps", all, "--json"]);
        let document = document(&output);
        let step = document["steps"]
            .as_array()
            .unwrap()
            .last()
            .unwrap()
            .clone();
        let got = step["probability"].as_f64().unwrap();
        assert!((got - probability).abs() < 1e-11, "{name} {steps}: {got}");
        let got = numbers(&step["belief"]);
        for (got, wanted) in got.iter().zip(belief.iter().flatten()) {
            assert!((got - wanted).abs() < 1e-11, "{name} {steps}: {got}");
        }
    }
}
