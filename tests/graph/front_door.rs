//! Graphs are started, found, adopted, followed and stopped by name.

use std::process::{Child, Output, Stdio};

use serde_json::Value;
use vigil_cycle::topic::ServiceName;
use vigil_cycle::{Domain, signal};

use crate::harness::{
    RunningGraph, binary, config_with, eventually, root, shared_machine, unique, wait,
};
use crate::killing::kill;

fn vigil(words: &[&str]) -> Output {
    binary("vigil").args(words).output().unwrap()
}

fn err(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

/// Starts a command that goes on; it is ended by the test.
fn spawn(words: &[&str]) -> Child {
    let mut command = binary("vigil");
    let command = command.args(words).env("TZ", "UTC").stdout(Stdio::piped());
    command.stderr(Stdio::piped()).spawn().unwrap()
}

/// What `vigil list` says of a graph, if it runs.
fn listed(name: &str) -> Option<Value> {
    let output = vigil(&["list", "--json"]);
    let document: Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(document["schema_version"], 1);
    let graphs = document["graphs"].as_array().unwrap();
    graphs.iter().find(|graph| graph["name"] == name).cloned()
}

/// Process ids of the services of a listed graph.
fn pids(graph: &Value) -> Vec<u32> {
    let services = graph["services"].as_array().unwrap().iter();
    services
        .map(|s| s["pid"].as_u64().unwrap() as u32)
        .collect()
}

/// The events of a running graph, as `vigil events --json` prints them.
fn events(name: &str, kind: &str) -> Vec<Value> {
    let output = vigil(&["events", "--json", "--graph", name]);
    let text = String::from_utf8(output.stdout).unwrap();
    let entries = text.lines().map(|line| serde_json::from_str(line).unwrap());
    entries
        .filter(|entry: &Value| entry["event"] == kind)
        .collect()
}

/// A graph of which the launcher was killed.
fn orphan(name: &str, options: &[&str]) -> Value {
    let mut launcher = spawn(&[&["run", "--no-blackbox", "--graph", name], options].concat());
    let graph = eventually("the graph drives", || {
        let graph = listed(name)?;
        (!events(name, "armed").is_empty()).then_some(graph)
    });
    assert_eq!(graph["launcher"], launcher.id());
    launcher.kill().unwrap();
    launcher.wait().unwrap();
    let orphan = listed(name).unwrap();
    assert_eq!(orphan["launcher"], Value::Null);
    assert_eq!(pids(&orphan), pids(&graph));
    orphan
}

#[test]
fn a_graph_that_hears_no_publisher_says_so_and_ends_with_1() {
    let name = unique("unheard");
    let source = [
        "--source",
        "external",
        "--start-timeout",
        "2",
        "--no-blackbox",
    ];
    let output = vigil(&[&["run", "--graph", &name], &source[..]].concat());
    assert_eq!(output.status.code(), Some(1), "{}", err(&output));
    let told = err(&output);
    let config = root().join("config/rover.toml");
    let config = config.display();
    assert!(
        told.contains(&format!(
            "graph '{name}' waits for a publisher (external): no frame has come; \
             `vigil check-publisher --config {config} --graph {name} --source external`"
        )),
        "{told}"
    );
    assert!(told.contains("no action came back within 2 s"), "{told}");
    let summary = String::from_utf8_lossy(&output.stdout).into_owned();
    assert!(
        summary.contains("no cycle ran through all services"),
        "{summary}"
    );
}

/// As a launcher does that is killed before it has listed what it has just started.
fn unlist(graph: &str, service: &str) {
    let list = Domain::running(graph).unwrap().launcher_file();
    let lines = std::fs::read_to_string(&list).unwrap();
    let others = lines.lines().filter(|line| !line.starts_with(service));
    let others: String = others.map(|line| format!("{line}\n")).collect();
    assert!(others.len() < lines.len());
    std::fs::write(list, others).unwrap();
}

#[test]
fn a_graph_whose_launcher_was_killed_is_listed_adopted_and_goes_on() {
    let _machine = shared_machine();
    let name = unique("adopted");
    let inject = ["--inject", "encoder:LF:zero@1", "--inject", "stuck:RM@500"];
    let graph = orphan(&name, &inject);
    let told = err(&vigil(&["status", "--graph", &unique("no-such")]));
    let running = told.split_once("; there run: ").unwrap().1;
    let mut running = running.trim().split(", ");
    assert!(running.any(|other| other == name), "{told}");
    let text = vigil(&["list"]);
    assert_eq!(text.status.code(), Some(1));
    let text = String::from_utf8_lossy(&text.stdout).into_owned();
    assert!(
        text.contains(&format!("vigil run --adopt --graph {name}")),
        "{text}"
    );
    let refused = vigil(&["run", "--graph", &name]);
    assert_eq!(refused.status.code(), Some(2));
    assert!(
        err(&refused).contains("their launcher is gone"),
        "{}",
        err(&refused)
    );

    unlist(&name, "identifier");
    let told = events(&name, "injected").len();
    let launcher = spawn(&["run", "--adopt", "--json", "--graph", &name]);
    let adopted = eventually("it is adopted", || {
        listed(&name).filter(|graph| !graph["launcher"].is_null())
    });
    assert_eq!(adopted["launcher"], launcher.id());
    assert_eq!(pids(&adopted), pids(&graph), "they drive on");
    let second = vigil(&["run", "--adopt", "--graph", &name]);
    assert_eq!(second.status.code(), Some(2));
    assert!(err(&second).contains("has a launcher"), "{}", err(&second));

    // A simulator that is restarted by the new launcher goes on with its broken rover.
    kill(pids(&graph)[ServiceName::SensorSim.index()]);
    let injected = eventually("it is restarted and broken again", || {
        let injected = events(&name, "injected");
        (injected.len() > told).then_some(injected)
    });
    assert_eq!(injected.len(), told + 1, "what was told is not told again");
    assert_eq!(injected[told]["what"], "encoder:LF:zero");
    let times: Vec<f64> = injected
        .iter()
        .map(|e| e["t_s"].as_f64().unwrap())
        .collect();
    assert!(times[0] > 0.9 && times[1] > times[0], "{times:?}");
    let restarted = listed(&name).unwrap();
    let again = pids(&restarted)[0];
    assert_ne!(again, pids(&graph)[0]);
    // What is still to break breaks there, too.
    let line = std::fs::read_to_string(format!("/proc/{again}/cmdline")).unwrap();
    assert!(line.contains("stuck:RM@500"), "{line}");

    assert_eq!(vigil(&["stop", "--graph", &name]).status.code(), Some(0));
    let output = wait(launcher);
    let summary: Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(summary["ended"], "stopped");
    assert_eq!(summary["services"]["sensor-sim"]["restarts"], 1);
    // The summary has what the launcher before has told, too.
    let count = |kind: &str| {
        let all = summary["events"].as_array().unwrap();
        all.iter().filter(|event| event["event"] == kind).count()
    };
    assert_eq!((count("injected"), count("adopted")), (told + 1, 1));
    assert_eq!(listed(&name), None);
}

#[test]
fn a_graph_whose_launcher_was_killed_is_stopped_and_leaves_nothing() {
    let _machine = shared_machine();
    let name = unique("orphan");
    let graph = orphan(&name, &[]);
    let stopped = vigil(&["stop", "--graph", &name]);
    assert_eq!(stopped.status.code(), Some(0), "{}", err(&stopped));
    assert_eq!(listed(&name), None);
    let domain = Domain::new(&name, vigil_cycle::domain::Queues::default()).unwrap();
    assert_eq!(domain.residue(), Vec::<std::path::PathBuf>::new());
    assert!(!domain.events_file().exists());
    for pid in pids(&graph) {
        assert_eq!(domain.find_process(pid), None, "{pid}");
    }
    // The name is free again.
    let again = vigil(&["run", "--graph", &name, "--duration", "1", "--no-blackbox"]);
    assert_eq!(again.status.code(), Some(0), "{}", err(&again));
}

#[test]
fn events_are_followed_until_the_graph_ends() {
    let _machine = shared_machine();
    let name = unique("events");
    let mut graph = RunningGraph::start("events", &["--inject", "stuck:RM@2"]);
    graph.observe();
    let follower = spawn(&["events", "--follow", "--graph", &name]);
    eventually("the fault is active", || {
        let faults = events(&name, "fault");
        (!faults.is_empty()).then_some(())
    });
    let alarm = &events(&name, "alarm")[0];
    assert!(alarm["t_s"].as_f64().unwrap() > 1.9, "{alarm}");
    let wall = alarm["wall"].as_str().unwrap();
    assert!(wall.ends_with('Z') && wall.contains('T'), "{wall}");
    graph.interrupt();
    let summary = graph.finish();
    let output = wait(follower);
    assert_eq!(output.status.code(), Some(0));
    assert!(
        err(&output).contains("the graph has ended"),
        "{}",
        err(&output)
    );
    let text = String::from_utf8_lossy(&output.stdout).into_owned();
    let (t_s, _) = summary.events("alarm")[0];
    let line = format!("{t_s:9.3} s  detector    alarm");
    let time = wall[11..].trim_end_matches('Z');
    assert!(
        text.contains(&format!("{time}  {line}")),
        "{time}  {line}\n{text}"
    );
    assert!(text.contains("RM_STUCK is active"), "{text}");
}

#[test]
fn a_name_that_does_not_run_is_said_and_leaves_nothing_behind() {
    let name = unique("no-such");
    for words in [
        &["events"][..],
        &["stop"],
        &["faults"],
        &["ack", "all"],
        &["clear"],
        &["inject", "stuck:RM"],
        &["run", "--adopt"],
        &["status"],
        &["top", "--once"],
        &["top", "--line"],
        &["snapshot"],
        &["recordings"],
    ] {
        let output = vigil(&[words, &["--graph", &name]].concat());
        assert!(!output.status.success(), "{words:?}");
        let told = err(&output);
        assert!(
            told.contains(&format!("no graph named '{name}' is running; ")),
            "{words:?}: {told}"
        );
    }
    let folder = Domain::new(&unique("other"), vigil_cycle::domain::Queues::default()).unwrap();
    let runtime = folder.folder().parent().unwrap();
    assert!(!runtime.join(&name).exists());
    std::fs::remove_dir_all(folder.folder()).unwrap();
}

#[test]
fn a_value_that_is_wrong_is_blamed_on_the_option_that_gave_it() {
    for command in ["check", "run", "config", "graph"] {
        let output = vigil(&[command, "--rate", "1e9"]);
        assert_eq!(output.status.code(), Some(2), "{command}");
        let expected = "--rate: 1000000000 is out of range: allowed is 1 to 10000\n";
        assert_eq!(err(&output), expected, "{command}");
    }
    // The file is to blame for what it says itself.
    let folder = std::env::temp_dir().join(unique("blamed"));
    let config = config_with(&folder, |text| {
        text.replace("rate_hz = 100.0", "rate_hz = 1e9")
    });
    let config = config.to_str().unwrap();
    let output = vigil(&["check", "--config", config]);
    let told = err(&output);
    assert!(
        told.starts_with(config) && told.contains("rate_hz"),
        "{told}"
    );
    let output = vigil(&["check", "--config", config, "--rate", "50"]);
    assert!(output.status.success(), "{}", err(&output));
    std::fs::remove_dir_all(folder).unwrap();
}

#[test]
fn options_that_mean_nothing_to_a_command_are_not_shown_and_taken_all_the_same() {
    for (command, hidden, shown) in [
        ("check-publisher", "--speed", "--rate"),
        ("record", "--identifier", "--graph"),
        ("graph", "--seed", "--replay"),
    ] {
        let output = vigil(&[command, "--help"]);
        let help = String::from_utf8(output.stdout).unwrap();
        let has = |option: &str| help.contains(&format!("{option} <"));
        assert_eq!(
            (has(hidden), has(shown)),
            (false, true),
            "{command}: {help}"
        );
    }
    let output = vigil(&["graph", "--seed", "3"]);
    assert!(output.status.success(), "{}", err(&output));
}

#[test]
fn a_launcher_that_is_asked_to_stop_while_it_waits_has_seen_nothing() {
    let name = unique("waits");
    let launcher = spawn(&[
        "run",
        "--graph",
        &name,
        "--source",
        "external",
        "--no-blackbox",
    ]);
    eventually("it is started", || Domain::running(&name));
    signal::terminate(launcher.id());
    let output = wait(launcher);
    assert_eq!(output.status.code(), Some(1), "{}", err(&output));
}
