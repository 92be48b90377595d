//! What a service does when time runs out, and what it asks of the kernel when it does not.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::Duration;

use vigil_cycle::{Clock, CycleStamps, Monotonic, stamps};

use crate::harness::{
    HealthWatch, RunningGraph, binary, config_with, eventually, launch, machine, root, unique,
};

/// What a service in its steady state may ask of the kernel, and how often in a cycle: to be woken,
/// and to wake the next. Allowed is half as much again as what it does at 100 Hz:
/// - A stage waits once (`timerfd_settime`, `ppoll`), and once more each fifth cycle, where its
///   Health is due 50 ms after the last and no input comes just then: 1.2.
/// - It empties its event socket once after a wake-up, twice if it runs before the one that wakes
///   it has noted that it did: 1 to 2 `recvfrom`.
/// - Each block that a service waits for is announced to that one: 1 `sendto` in each service but
///   the last. Nobody waits for particles, actions or Health.
/// - The source sleeps once, and looks after its Health when it is awake.
const ALLOWED: [(&str, f64); 5] = [
    ("ppoll", 1.8),
    ("recvfrom", 3.0),
    ("sendto", 1.5),
    ("timerfd_settime", 1.8),
    ("clock_nanosleep", 1.5),
];
/// Calls beyond that where the tracer comes and goes.
const EDGE_CALLS: f64 = 10.0;

const SERVICES: [&str; 4] = ["sensor-sim", "detector", "identifier", "supervisor"];

fn signal(name: &str, pid: u32) {
    let status = Command::new("kill")
        .args([name, &pid.to_string()])
        .status()
        .unwrap();
    assert!(status.success());
}

fn folder(name: &str) -> PathBuf {
    let folder = std::env::temp_dir().join(unique(name));
    std::fs::create_dir_all(&folder).unwrap();
    folder
}

#[test]
fn a_service_that_is_stopped_is_found_ended_and_restarted() {
    let _machine = machine();
    let folder = folder("hang");
    let config = config_with(&folder, |text| {
        format!("{text}\n[watchdog]\nalive_s = 0.5\ndeadline_percent = 0.0\n")
    });
    let mut graph = RunningGraph::start_with(config, "hang", &["--duration", "60"]);
    let observed = graph.observe();
    let mut health = HealthWatch::new(&observed);
    eventually("all services run", || health.all_running().then_some(()));
    let before = health.poll()["identifier"];
    signal("-STOP", before.pid);
    eventually("it is restarted and works", || {
        let now = health.poll()["identifier"];
        (now.header.epoch != before.header.epoch && now.cycles > 10).then_some(())
    });
    graph.interrupt();
    let summary = graph.finish();
    let found = summary.events("watchdog");
    let words: Vec<&str> = found.iter().map(|event| event.1.as_str()).collect();
    assert_eq!(words, ["has stopped reporting"]);
    assert_eq!(summary.service("identifier", "restarts"), 1);
    std::fs::remove_dir_all(&folder).unwrap();
}

#[test]
fn a_miss_ends_the_graph_where_that_is_wanted() {
    let _machine = machine();
    let folder = folder("stop");
    let config = config_with(&folder, |text| {
        // 13 us after the schedule at 1 kHz: nobody can do that.
        let text = text.replace("deadline_percent = 95.0", "deadline_percent = 1.3");
        let text = text.replace("deadline_percent = 75.0", "deadline_percent = 1.2");
        let text = text.replace("deadline_percent = 50.0", "deadline_percent = 1.1");
        let text = text.replace("deadline_percent = 20.0", "deadline_percent = 1.0");
        text.replace(
            "core = 1, priority = 53",
            "core = 1, on_miss = \"stop\", priority = 53",
        )
    });
    let output = binary("vigil-launcher")
        .args([
            "--json",
            "--no-blackbox",
            "--duration",
            "60",
            "--rate",
            "1000",
        ])
        .arg("--graph")
        .arg(unique("stop"))
        .arg("--config")
        .arg(&config)
        .output()
        .unwrap();
    assert_eq!(output.status.code(), Some(1), "a run with a failure");
    let json: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(json["ended"], "gave-up");
    assert!(json["gave_up"].as_str().unwrap().starts_with("supervisor"));
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(said.contains("a deadline was missed"), "{said}");
    assert_eq!(json["services"]["supervisor"]["restarts"], 0);
    std::fs::remove_dir_all(&folder).unwrap();
}

/// Every instant of the schedule and its latency, those included that only a later block answered.
fn latencies_ns(stamps: &[CycleStamps], period_ns: u64) -> Vec<(u64, u64)> {
    let done: BTreeMap<u64, u64> = stamps
        .iter()
        .map(|s| (s.t_schedule_ns, s.t_publish_ns))
        .collect();
    let (first, last) = (
        done.first_key_value().unwrap(),
        done.last_key_value().unwrap(),
    );
    let instants = (last.0 - first.0) / period_ns;
    (0..=instants)
        .map(|k| {
            let due_ns = first.0 + k * period_ns;
            (due_ns, done.range(due_ns..).next().unwrap().1 - due_ns)
        })
        .collect()
}

#[test]
fn a_stall_shows_as_long_as_it_was_and_in_every_cycle_it_delayed() {
    let _machine = machine();
    let folder = folder("stall");
    let left = folder.display().to_string();
    let mut graph = RunningGraph::start("stall", &["--duration", "60", "--stamps", &left]);
    let observed = graph.observe();
    let mut health = HealthWatch::new(&observed);
    eventually("all services run", || health.all_running().then_some(()));
    let pid = health.poll()["detector"].pid;
    eventually("it has been at work for a while", || {
        (health.poll()["supervisor"].cycles > 300).then_some(())
    });
    let mut stalls = Vec::new();
    for _ in 0..3 {
        signal("-STOP", pid);
        let from_ns = Monotonic.now_ns();
        std::thread::sleep(Duration::from_millis(200));
        stalls.push((from_ns, Monotonic.now_ns()));
        signal("-CONT", pid);
        let cycles = health.poll()["supervisor"].cycles;
        eventually("actions go out again", || {
            (health.poll()["supervisor"].cycles > cycles + 20).then_some(())
        });
    }
    graph.interrupt();
    let period_ns = graph.setup.period_ns();
    let deadline_ns = period_ns / 100 * 95;
    let summary = graph.finish();
    let kept = stamps::read(&folder.join("supervisor.stamps")).unwrap();
    let latencies = latencies_ns(&kept, period_ns);
    for (from_ns, to_ns) in stalls {
        // What was due while the detector stood still (it stops a moment after it was told to) was
        // not done before it went on, and its latency says so.
        let within = latencies
            .iter()
            .filter(|(due_ns, _)| (from_ns + period_ns..to_ns).contains(due_ns));
        let within: Vec<_> = within.collect();
        let instants = (to_ns - from_ns) / period_ns;
        let least = instants as usize - 2;
        assert!(
            within.len() >= least,
            "{} of {instants} instants",
            within.len()
        );
        for (due_ns, latency_ns) in within {
            assert!(due_ns + latency_ns >= to_ns, "{due_ns}: {latency_ns} ns");
        }
    }
    // The histogram says the same of the longest, to its three digits.
    let longest_ns = latencies.iter().map(|(_, ns)| ns).max().unwrap();
    let max_us = summary.json["end_to_end_us"]["max"].as_f64().unwrap();
    assert_eq!((max_us * 1e3).round() as u64, *longest_ns);
    // And the monitor counts each late one, once; it may have counted more at the very end.
    let late = latencies.iter().filter(|(_, ns)| *ns > deadline_ns).count() as u64;
    let monitor = summary.service("supervisor", "missed");
    assert!(
        (late..late + 3).contains(&monitor),
        "{monitor} against {late}"
    );
    for service in SERVICES {
        if summary.json["services"][service]["memory_locked"] == true {
            let faults = &summary.json["services"][service]["page_faults"];
            let [minor, major] = [0, 1].map(|i| faults[i].as_u64().unwrap());
            assert!(minor <= 1 && major == 0, "{service}: {faults} page faults");
        }
    }
    std::fs::remove_dir_all(&folder).unwrap();
}

/// System calls that a process makes in a while, name and how often; `None` if it cannot be traced.
fn system_calls(pid: u32, folder: &Path) -> Option<BTreeMap<String, u64>> {
    let out = folder.join(format!("{pid}.calls"));
    let mut tracer = Command::new("strace")
        .args(["-f", "-c", "-U", "calls,name", "-o"])
        .arg(&out)
        .args(["-p", &pid.to_string()])
        .stdin(Stdio::null())
        .stderr(Stdio::null())
        .spawn()
        .ok()?;
    std::thread::sleep(Duration::from_secs(2));
    if !matches!(tracer.try_wait(), Ok(None)) {
        return None;
    }
    vigil_cycle::signal::terminate(tracer.id());
    let _ = tracer.wait();
    let text = std::fs::read_to_string(&out).unwrap_or_default();
    let counts = text.lines().filter_map(|line| {
        let (count, name) = line.trim().split_once(' ')?;
        Some((name.trim().to_owned(), count.parse().ok()?))
    });
    Some(counts.filter(|(name, _)| name != "total").collect())
}

/// The calls of `cycles` cycles that are not allowed, or too many.
fn strange(calls: &BTreeMap<String, u64>, cycles: u64) -> Vec<String> {
    let most = |name: &str| {
        let allowed = ALLOWED.iter().find(|(call, _)| *call == name);
        match allowed {
            Some((_, in_a_cycle)) => in_a_cycle * cycles as f64 + EDGE_CALLS,
            // Where the tracer interrupts a wait, the kernel restarts it once.
            None if name == "restart_syscall" => 1.0,
            None => 0.0,
        }
    };
    let found = calls
        .iter()
        .filter(|(name, count)| **count as f64 > most(name.as_str()));
    found
        .map(|(name, count)| format!("{count} {name}"))
        .collect()
}

#[test]
fn a_steady_cycle_asks_the_kernel_for_nothing_but_waking() {
    let _machine = machine();
    let folder = folder("calls");
    let mut graph = RunningGraph::start("calls", &["--duration", "60"]);
    let observed = graph.observe();
    let mut health = HealthWatch::new(&observed);
    eventually("all services run", || health.all_running().then_some(()));
    eventually("they are in their steady state", || {
        (health.poll()["supervisor"].cycles > 300).then_some(())
    });
    for service in SERVICES {
        let before = health.poll()[service];
        let Some(calls) = system_calls(before.pid, &folder) else {
            eprintln!("SKIPPED: strace is missing or may not attach; system calls are not counted");
            break;
        };
        // Health goes out each 50 ms: that of after the last counted call. The cycles around the
        // traced time, which count as well, are a tenth of all.
        std::thread::sleep(Duration::from_millis(100));
        let cycles = health.poll()[service].cycles - before.cycles;
        let waits = calls.get("ppoll").or(calls.get("clock_nanosleep"));
        assert!(waits.is_some_and(|n| *n > 50), "{service}: {calls:?}");
        let strange = strange(&calls, cycles);
        assert!(
            strange.is_empty(),
            "{service}: {strange:?} of {calls:?} in {cycles} cycles"
        );
    }
    graph.interrupt();
    graph.finish();
    std::fs::remove_dir_all(&folder).unwrap();
}

#[test]
fn calls_that_are_too_many_for_their_cycles_or_not_allowed_are_strange() {
    let calls = |sendto: u64, last: (&str, u64)| {
        let each = [("ppoll", 240), ("recvfrom", 400), ("sendto", sendto), last];
        BTreeMap::from(each.map(|(name, count)| (name.to_owned(), count)))
    };
    let usual = calls(200, ("restart_syscall", 1));
    assert_eq!(strange(&usual, 200), Vec::<String>::new());
    assert_eq!(
        strange(&calls(2000, ("futex", 1)), 200),
        ["1 futex", "2000 sendto"]
    );
}

/// A program that may ask neither for real-time priority nor for locked memory, nor may what it
/// starts; `None` if these rights cannot be taken away here.
fn unprivileged(program: &str) -> Option<Command> {
    let without = |program: &str| {
        let mut command = Command::new("setpriv");
        command
            .arg("--bounding-set=-sys_nice,-ipc_lock")
            .arg("--inh-caps=-sys_nice,-ipc_lock")
            .args(["prlimit", "--rtprio=0", "--memlock=65536"])
            .arg(program)
            .current_dir(root())
            .env_remove("VIGIL_CONFIG");
        command
    };
    let tried = without("true").stderr(Stdio::null()).status();
    matches!(tried, Ok(status) if status.success()).then(|| without(program))
}

#[test]
fn a_graph_without_any_privilege_works_and_says_what_it_did_not_get() {
    let _machine = machine();
    let launcher = binary("vigil-launcher");
    let Some(mut command) = unprivileged(launcher.get_program().to_str().unwrap()) else {
        eprintln!("SKIPPED: setpriv and prlimit are missing or may not take rights away");
        return;
    };
    let output = command
        .args(["--json", "--no-blackbox", "--duration", "4"])
        .args(["--config", "config/rover.toml"])
        .args(["--graph", &unique("plain")])
        .output()
        .unwrap();
    assert!(output.status.success(), "launcher: {}", output.status);
    let json: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(json["ended"], "duration");
    for service in SERVICES {
        let of = &json["services"][service];
        assert_eq!(of["scheduling"], "other", "{service}");
        assert_eq!(of["memory_locked"], false, "{service}");
        assert!(of["cycles"].as_u64().unwrap() > 200, "{service}");
        // The least that can be set; nobody needs a privilege for it.
        assert_eq!(of["timer_slack_ns"], 1, "{service}");
    }
}

#[test]
fn a_stage_that_looks_for_its_input_before_it_sleeps_does_the_same_work() {
    let _machine = machine();
    let folder = folder("spin");
    let config = config_with(&folder, |text| {
        let text = text.replace("supervisor = { core = 1", "supervisor = { core = 0");
        text.replace(
            "identifier = { core = 1",
            "identifier = { spin_us = 1000.0, core = 1",
        )
    });
    let options = ["--duration", "6", "--inject", "stuck:RM@2"];
    let graph = RunningGraph::start_with(config, "spin", &options);
    let summary = graph.finish();
    // Every frame was taken, whether it was found or announced, and none twice.
    let [detected, identified] =
        ["detector", "identifier"].map(|service| summary.service(service, "cycles"));
    assert!(
        identified > 500 && identified <= detected,
        "{identified} of {detected}"
    );
    assert_eq!(summary.service("identifier", "duplicate"), 0);
    let named = summary.events("diagnosis");
    assert!(named.iter().any(|event| event.1 == "RM_STUCK"), "{named:?}");
    std::fs::remove_dir_all(&folder).unwrap();
}

#[test]
fn a_spin_on_a_shared_core_or_for_too_long_is_refused() {
    let folder = folder("spin-bad");
    for (from, to, said) in [
        (
            "identifier = { core = 1",
            "identifier = { spin_us = 100.0, core = 1",
            "a core of its own",
        ),
        (
            "sensor-sim = { core = 0",
            "sensor-sim = { spin_us = 2001.0, core = 0",
            "a fifth of the period",
        ),
    ] {
        let config = config_with(&folder, |text| text.replace(from, to));
        let output = launch(&config, "spin-bad", &[]);
        assert_eq!(output.status.code(), Some(2));
        let text = String::from_utf8_lossy(&output.stderr).into_owned();
        assert!(text.contains("spin_us") && text.contains(said), "{text}");
    }
    std::fs::remove_dir_all(&folder).unwrap();
}
