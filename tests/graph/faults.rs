//! The life of a fault, as an operator sees it.

use serde_json::Value;
use vigil_blocks::Faults;
use vigil_cycle::{Graph, Receiver, Topic};

use crate::harness::{
    HealthWatch, RunningGraph, binary, drain, eventually, shared_machine, unique,
};

/// What `vigil` answers: exit code, standard output, standard error.
fn vigil(graph: &str, words: &[&str]) -> (i32, String, String) {
    let mut command = binary("vigil");
    let output = command
        .args(words)
        .args(["--graph", graph])
        .output()
        .unwrap();
    let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
    (
        output.status.code().unwrap(),
        text(&output.stdout),
        text(&output.stderr),
    )
}

fn listed(graph: &str) -> (i32, Value) {
    let (code, out, err) = vigil(graph, &["faults", "--json"]);
    (code, serde_json::from_str(&out).expect(&err))
}

/// Waits until the only fault is in this state.
fn until(graph: &str, state: &str) -> Value {
    eventually(state, || {
        let (_, document) = listed(graph);
        let faults = document["faults"].as_array().unwrap();
        assert!(faults.len() < 2, "{document}");
        let fault = faults.first()?;
        (fault["state"] == state).then(|| document.clone())
    })
}

/// What was measured at the onset, with names and units.
fn assert_freeze_frame(frame: &Value) {
    let has = |what: &str, name: &str, unit: &str| {
        let all = frame[what].as_array().unwrap();
        all.iter()
            .any(|one| one["name"] == name && one["unit"] == unit)
    };
    assert!(has("channels", "enc_RM", "rad/s"), "{frame}");
    assert!(has("command", "cmd_speed", "m/s"), "{frame}");
}

#[test]
fn a_fault_lives_from_its_onset_until_it_is_cleared_and_outlives_the_supervisor() {
    let _machine = shared_machine();
    let name = unique("faults");
    let options = ["--inject", "stuck:RM@2", "--inject", "clear:all@14"];
    let mut graph = RunningGraph::start("faults", &options);
    let observer = graph.observe();
    let document = until(&name, "active");
    assert_eq!(document["overall"], "fault");
    assert_eq!(listed(&name).0, 1);
    let fault = &document["faults"][0];
    assert_eq!((&fault["number"], &fault["count"]), (&1.into(), &1.into()));
    // It may still be without a name; then the name comes.
    let named = eventually("a name", || {
        let document = listed(&name).1;
        (document["faults"][0]["name"] == "RM_STUCK").then_some(document)
    });
    let fault = &named["faults"][0];
    assert_eq!(fault["number"], 1, "the same fault: {named}");
    assert!(fault["evidence"]["nat"].as_f64().unwrap() > 0.0);
    assert_freeze_frame(&fault["freeze_frame"]);
    let (code, _, err) = vigil(&name, &["ack", "LM_STUCK"]);
    assert_eq!(
        (code, err.trim()),
        (2, "no fault 'LM_STUCK'; there are RM_STUCK (1)")
    );
    let acknowledged = format!("graph '{name}': acknowledged RM_STUCK");
    let (code, _, err) = vigil(&name, &["ack", "rm_stuck"]);
    assert_eq!((code, err.trim()), (0, acknowledged.as_str()));
    assert_eq!(listed(&name).1["faults"][0]["state"], "acknowledged");
    let again = vigil(&name, &["ack", "1"]);
    let already = "RM_STUCK is acknowledged already";
    assert_eq!((again.0, again.2.trim()), (1, already));

    restart(&observer, "supervisor");
    let document = until(&name, "acknowledged");
    assert_eq!(document["faults"][0]["number"], 1, "{document}");

    let document = until(&name, "cleared");
    assert_eq!(document["overall"], "ok");
    assert_eq!(listed(&name).0, 0);
    let (code, _, err) = vigil(&name, &["clear"]);
    let forgot = format!("graph '{name}': forgot the faults that were over");
    assert_eq!((code, err.trim()), (0, forgot.as_str()));
    assert_eq!(listed(&name).1["faults"], Value::from(Vec::<Value>::new()));

    // Ten blocks a second, also while nothing changes.
    let mut faults: Box<dyn Receiver<Faults>> = observer.receiver(Topic::Faults).unwrap();
    let mut count = 0;
    eventually("heartbeats", || {
        drain(faults.as_mut(), |_| count += 1);
        (count > 10).then_some(())
    });
    drop(observer);
    graph.interrupt();
    let summary = graph.finish();
    let told: Vec<(f64, String)> = summary.events("fault");
    let states: Vec<&str> = told
        .iter()
        .map(|it| it.1.rsplit(' ').next().unwrap())
        .collect();
    assert_eq!(states.last(), Some(&"cleared"), "{told:?}");
    assert_eq!(
        states.iter().filter(|it| **it == "acknowledged").count(),
        1,
        "{told:?}"
    );
}

/// Kills a service and waits for another.
fn restart(observer: &Graph, service: &str) {
    let mut watch = HealthWatch::new(observer);
    let pid = eventually("its process", || {
        watch.poll().get(service).map(|health| health.pid)
    });
    crate::killing::kill(pid);
    eventually("another process", || {
        let health = watch.poll().get(service)?;
        (health.pid != pid && health.cycles > 0).then_some(())
    });
}

#[test]
fn a_graph_that_does_not_run_has_no_faults_to_list() {
    let (code, out, err) = vigil("no-such-graph", &["faults"]);
    assert_eq!((code, out.as_str()), (1, ""));
    let begins = "no graph named 'no-such-graph' is running; ";
    assert!(err.starts_with(begins), "{err}");
}
