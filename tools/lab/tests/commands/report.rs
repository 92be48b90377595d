//! `vigil evaluate --report --filters`: the page and the document say the same.

use std::fs::{self, File};
use std::io::Read;
use std::path::Path;
use std::process::{Command, Output};

use flate2::read::GzDecoder;
use roxmltree::{Document, Node, ParsingOptions};
use serde_json::Value;
use tempfile::TempDir;

use super::workplace::root;

const MODEL: &str = "config/models/rover.toml";
const RUNS: &str = "tests/data/rover/learn_runs.csv";
/// Runs that the shipped model was not learned from: two nominal ones, six stuck wheels, two broken
/// encoders.
const IDS: [u32; 10] = [2, 22, 3, 7, 10, 12, 39, 66, 424, 431];

fn evaluate(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_vigil-lab"))
        .args(["evaluate", "--model", MODEL, "--runs", RUNS])
        .args(arguments)
        .current_dir(root())
        .output()
        .unwrap()
}

/// The frames of a few runs.
fn frames(folder: &Path) -> String {
    let mut text = String::new();
    let file = File::open(root().join("tests/data/rover/learn_frames.csv.gz")).unwrap();
    GzDecoder::new(file).read_to_string(&mut text).unwrap();
    let mut lines = text.lines();
    let mut kept = vec![lines.next().unwrap()];
    kept.extend(lines.filter(|line| {
        let run = line.split(',').next().unwrap().parse().unwrap();
        IDS.contains(&run)
    }));
    let path = folder.join("frames.csv");
    fs::write(&path, kept.join("\n")).unwrap();
    path.display().to_string()
}

fn text(node: Node<'_, '_>) -> String {
    let words = node.descendants().filter(Node::is_text);
    let words = words.filter_map(|node| node.text());
    words.collect::<Vec<_>>().concat().trim().to_owned()
}

/// Cells of a section's rows, those of nested rows too.
fn rows(page: &Document<'_>, section: &str) -> Vec<Vec<String>> {
    let mut sections = page
        .descendants()
        .filter(|node| node.attribute("id") == Some(section));
    let rows = sections.next().unwrap().descendants();
    let rows = rows.filter(|node| node.has_tag_name("tr"));
    let cells = |row: Node<'_, '_>| {
        let cells = row.children().filter(Node::is_element);
        cells.map(text).collect()
    };
    rows.map(cells).collect()
}

fn percent(ratio: &Value) -> String {
    let p = |key: &str| format!("{:.1}", 100.0 * ratio[key].as_f64().unwrap());
    format!(
        "{} % ({}/{}; {} to {})",
        p("fraction"),
        ratio["right"],
        ratio["n"],
        p("lower_95"),
        p("upper_95")
    )
}

fn seconds(delay: &Value) -> String {
    let s = |key: &str| {
        delay[key]
            .as_f64()
            .map_or("-".into(), |s| format!("{s:.2}"))
    };
    [s("p50_s"), s("p90_s"), s("max_s")].join(" / ")
}

/// The figures on top are those of the document, in the column of their channels.
fn check_summary(page: &Document<'_>, document: &Value) {
    let rows = rows(page, "summary");
    let start = rows
        .iter()
        .position(|row| row[0].starts_with("stuck, "))
        .unwrap();
    let find = |name: &str| rows[start..].iter().find(|row| row[0] == name).unwrap();
    for (column, set) in [(1, "pose"), (2, "pose+encoders")] {
        let score = &document["sensor_sets"][set];
        let (found, named) = (
            &score["detection"]["stuck"],
            &score["identification"]["stuck"],
        );
        assert_eq!(
            find("detected")[column],
            percent(&found["within"]["at_end"])
        );
        assert_eq!(
            find("delay p50 / p90 / max, s")[column],
            seconds(&found["delay"])
        );
        assert_eq!(
            find("leaf right at 2 s")[column],
            percent(&named["leaf"]["after_2_s"])
        );
        assert_eq!(
            find("side right at 10 s")[column],
            percent(&named["side"]["after_10_s"])
        );
        let calibration = &score["calibration"]["stuck"];
        let log_score = calibration["log_score_nats"].as_f64().unwrap();
        let name = "log score of the true mode at 2 s, nats";
        assert_eq!(find(name)[column], format!("{log_score:.3}"));
        let rate = &score["false_alarms"];
        let p = |key: &str| format!("{:.2}", rate[key].as_f64().unwrap());
        let [an_hour, lower, upper] =
            ["false_alarms_per_h", "lower_95_per_h", "upper_95_per_h"].map(p);
        let row = rows
            .iter()
            .find(|row| row[0] == "false alarms an hour")
            .unwrap();
        assert_eq!(row[column], format!("{an_hour} ({lower} to {upper})"));
    }
}

/// What was measured is the configured threshold's point of the curve.
fn check_trade_off(document: &Value) {
    for set in ["pose", "pose+encoders"] {
        let score = &document["sensor_sets"][set];
        let here = &score["trade_off"]["configured"];
        assert_eq!(here["false_alarms"], score["false_alarms"]["alarms"]);
        for (class, found) in here["detection"].as_object().unwrap() {
            let measured = &score["detection"][class];
            assert_eq!(found["detected"], measured["detected"], "{set} {class}");
            assert_eq!(found["n"], measured["n"], "{set} {class}");
            assert_eq!(
                seconds(&found["delay"]),
                seconds(&measured["delay"]),
                "{set} {class}"
            );
        }
        assert!(score["trade_off"]["points"].as_array().unwrap().len() > 20);
    }
}

fn check_filters(page: &Document<'_>, document: &Value) {
    let rows = rows(page, "filters");
    for set in ["pose", "pose+encoders"] {
        let filters = document["filters"][set]["stuck"].as_array().unwrap();
        let names: Vec<&Value> = filters.iter().map(|row| &row["filter"]).collect();
        assert_eq!(names, ["multiple-hypothesis", "imm"]);
        assert!(filters[0]["leaf"]["after_2_s"]["difference"].is_null());
        let leaf = &filters[1]["leaf"]["after_2_s"];
        let p = |value: &Value, key: &str| 100.0 * value[key].as_f64().unwrap();
        let apart = &leaf["difference"];
        let wanted = format!(
            "{:.1} % ({}/{}){:+.1} ({:+.1}, {:+.1})",
            p(leaf, "fraction"),
            leaf["right"],
            leaf["n"],
            p(apart, "mean"),
            p(apart, "lower_95"),
            p(apart, "upper_95")
        );
        assert!(
            rows.iter().any(|row| row[0] == "imm" && row[1] == wanted),
            "{set}: {wanted} in {rows:?}"
        );
        // The same filter on the same runs gives the same figures, whoever asks for them.
        let named = &document["sensor_sets"][set]["identification"]["stuck"]["leaf"];
        assert_eq!(
            filters[0]["leaf"]["after_2_s"]["right"],
            named["after_2_s"]["right"]
        );
    }
}

#[test]
fn the_page_and_the_document_say_the_same() {
    let folder = TempDir::new().unwrap();
    let frames = frames(folder.path());
    let out = folder.path().join("out.html").display().to_string();
    let asked = ["--frames", &frames, "--json", "--sensors", "pose"];
    let output = evaluate(&[&asked[..], &["--report", &out, "--filters", "imm"]].concat());
    assert_eq!(String::from_utf8_lossy(&output.stderr), "");
    assert!(output.status.success());
    let document: Value = serde_json::from_slice(&output.stdout).unwrap();
    let html = fs::read_to_string(&out).unwrap();
    let options = ParsingOptions {
        allow_dtd: true,
        ..ParsingOptions::default()
    };
    let page = Document::parse_with_options(&html, options).unwrap();
    check_summary(&page, &document);
    check_trade_off(&document);
    check_filters(&page, &document);
    for word in ["http://", "https://", "src=", "<script"] {
        assert!(!html.contains(word), "{word}");
    }
    for key in ["model_hash", "tree_hash", "detector", "identifier"] {
        assert!(html.contains(document[key].as_str().unwrap()), "{key}");
    }

    // Without page and filters: the same figures for the channels asked for, and nothing else.
    let output = evaluate(&asked);
    let plain: Value = serde_json::from_slice(&output.stdout).unwrap();
    let mut rest = document.clone();
    for key in ["sensor_sets", "filters"] {
        assert!(plain.get(key).is_none(), "{key}");
        rest.as_object_mut().unwrap().remove(key).unwrap();
    }
    assert_eq!(plain, rest);
    assert_eq!(plain["runs"].as_object().unwrap().len(), 4);
    assert_eq!(
        plain["detection"]["all"],
        document["sensor_sets"]["pose"]["detection"]["all"]
    );
}

#[test]
fn a_page_that_cannot_be_written_and_a_filter_that_does_not_exist_are_refused_first() {
    let folder = TempDir::new().unwrap();
    let place = folder.path().display().to_string();
    let missing = folder.path().join("no/out.html").display().to_string();
    // The frames do not exist: what is refused before them was looked at before the work.
    for (option, wanted) in [
        (["--report", &missing], "--report: there is no folder"),
        (["--report", &place], "is a folder, a file is wanted"),
        (
            ["--filters", "multiple-hypothesis,kalman"],
            "possible values: multiple-hypothesis, bootstrap",
        ),
    ] {
        let output = evaluate(&[&["--frames", "none.csv"][..], &option].concat());
        let message = String::from_utf8_lossy(&output.stderr).into_owned();
        assert_eq!(output.status.code(), Some(2), "{message}");
        assert!(message.contains(wanted), "{message}");
        assert!(output.stdout.is_empty());
    }
    assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 0);
}

/// A page of the same runs without their labels: a chart and a table of changes for each.
#[test]
fn unlabelled_runs_have_a_page_too() {
    let folder = TempDir::new().unwrap();
    let frames = frames(folder.path());
    let out = folder.path().join("runs.html").display().to_string();
    let output = Command::new(env!("CARGO_BIN_EXE_vigil-lab"))
        .args([
            "report", "--model", MODEL, "--frames", &frames, "--out", &out,
        ])
        .current_dir(root())
        .output()
        .unwrap();
    assert!(output.status.success(), "{output:?}");
    let html = fs::read_to_string(&out).unwrap();
    let options = ParsingOptions {
        allow_dtd: true,
        ..ParsingOptions::default()
    };
    let page = Document::parse_with_options(&html, options).unwrap();
    let drawings = page.descendants().filter(|node| node.has_tag_name("svg"));
    assert_eq!(drawings.count(), IDS.len());
    // Run 3 has a stuck wheel: its table says so, with the alarm.
    let stuck = rows(&page, "belief");
    let stuck = stuck
        .iter()
        .filter(|row| row.get(1).is_some_and(|alarm| alarm == "alarm"));
    assert!(stuck.into_iter().any(|row| row[2].ends_with("_STUCK")));
}

/// What is asked for is a recording or frames; what does not fit is named.
#[test]
fn a_page_is_of_a_recording_or_of_frames() {
    let folder = TempDir::new().unwrap();
    let out = folder.path().join("run.html").display().to_string();
    let no_recording = folder.path().join("a.mcap");
    fs::write(&no_recording, "t_s,x_m\n").unwrap();
    let no_recording = no_recording.display().to_string();
    for (words, wanted) in [
        (
            &[][..],
            "give a RECORDING (MCAP), or frames with --model and --frames",
        ),
        (&[no_recording.as_str()], "a.mcap is no MCAP file"),
        (&["missing.mcap"], "cannot read missing.mcap"),
        (
            &["a.mcap", "--seed", "3"],
            "cannot be used with '--seed <S>'",
        ),
        (
            &["a.mcap", "--model", MODEL, "--frames", "f.csv"],
            "cannot be used with",
        ),
        (&["--frames", "f.csv"], "--model <MODEL>"),
    ] {
        let output = Command::new(env!("CARGO_BIN_EXE_vigil-lab"))
            .arg("report")
            .args(words)
            .args(["-o", &out])
            .output()
            .unwrap();
        let message = String::from_utf8_lossy(&output.stderr).into_owned();
        assert_eq!(output.status.code(), Some(2), "{words:?}: {message}");
        assert!(message.contains(wanted), "{words:?}: {message}");
    }
    assert!(!Path::new(&out).exists());
}
