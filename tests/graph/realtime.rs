//! What a service does when time runs out, and what it asks of the kernel when it does not.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::Duration;

use vigil_cycle::{Clock, CycleStamps, Monotonic, stamps};

use crate::harness::{
    HealthWatch, Running, binary, config_with, eventually, launch, machine, unique,
};

/// What a service in its steady state may ask of the kernel: to be woken, and to wake the next.
const ALLOWED: [&str; 5] = [
    "ppoll",
    "recvfrom",
    "sendto",
    "timerfd_settime",
    "clock_nanosleep",
];

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
    let mut graph = Running::start_with(config, "hang", &["--duration", "60"]);
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
        .args(["--json", "--duration", "60", "--rate", "1000", "--graph"])
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
    let mut graph = Running::start("stall", &["--duration", "60", "--stamps", &left]);
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

#[test]
fn a_steady_cycle_asks_the_kernel_for_nothing_but_waking() {
    let _machine = machine();
    let folder = folder("calls");
    let mut graph = Running::start("calls", &["--duration", "60"]);
    let observed = graph.observe();
    let mut health = HealthWatch::new(&observed);
    eventually("all services run", || health.all_running().then_some(()));
    eventually("they are in their steady state", || {
        (health.poll()["supervisor"].cycles > 300).then_some(())
    });
    for service in SERVICES {
        let Some(calls) = system_calls(health.poll()[service].pid, &folder) else {
            eprintln!("SKIPPED: strace is missing or may not attach; system calls are not counted");
            break;
        };
        let waits = calls.get("ppoll").or(calls.get("clock_nanosleep"));
        assert!(waits.is_some_and(|n| *n > 50), "{service}: {calls:?}");
        let allowed = BTreeSet::from(ALLOWED);
        let others: Vec<_> = calls
            .iter()
            .filter(|(name, _)| !allowed.contains(name.as_str()))
            .collect();
        // Where the tracer interrupts a wait, the kernel restarts it once.
        let restarted =
            |(name, n): &&(&String, &u64)| name.as_str() == "restart_syscall" && **n == 1;
        let strange: Vec<_> = others.iter().filter(|call| !restarted(call)).collect();
        assert!(strange.is_empty(), "{service}: {strange:?} of {calls:?}");
    }
    graph.interrupt();
    graph.finish();
    std::fs::remove_dir_all(&folder).unwrap();
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
    let graph = Running::start_with(config, "spin", &options);
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
