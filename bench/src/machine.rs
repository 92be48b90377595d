//! Facts about the machine, read from it.

use std::fs;
use std::process::Command;

use serde_json::{Value, json};

use crate::archive::output;

const CLOCKSOURCE: &str = "/sys/devices/system/clocksource/clocksource0/current_clocksource";

/// What a reader of a figure must know: processor, cores, kernel, preemption, clock, load,
/// virtualisation, compiler, commit.
#[must_use]
pub fn facts() -> Value {
    let cores = std::thread::available_parallelism().map_or(0, std::num::NonZero::get);
    let cpuinfo = read("/proc/cpuinfo");
    let field = |name: &str| {
        let line = cpuinfo.lines().find(|line| line.starts_with(name));
        line.and_then(|l| l.split_once(':'))
            .map_or("", |(_, v)| v.trim())
            .to_owned()
    };
    json!({
        "processor": field("model name"),
        "hypervisor": field("flags").split(' ').any(|flag| flag == "hypervisor"),
        "cores": cores,
        "kernel": output(Command::new("uname").args(["-srv"])),
        "clocksource": read(CLOCKSOURCE).trim(),
        "cores_isolated": read("/sys/devices/system/cpu/isolated").trim(),
        "rt_runtime_us": read("/proc/sys/kernel/sched_rt_runtime_us").trim(),
        "load_average": read("/proc/loadavg").trim(),
        "rustc": output(Command::new("rustc").arg("--version")),
        "commit": output(Command::new("git").args(["rev-parse", "HEAD"])),
        "uncommitted_changes":
            !output(Command::new("git").args(["status", "--porcelain", "-uno"])).is_empty(),
    })
}

fn read(path: &str) -> String {
    fs::read_to_string(path).unwrap_or_default()
}
