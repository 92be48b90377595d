//! Facts about the machine, read from it.

use std::fs;
use std::process::Command;

use serde_json::{Value, json};

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
        "uncommitted_changes": !changed().is_empty(),
    })
}

/// A tracked file that differs from the commit; empty if none does. Results do not count: they
/// change with each measurement, and none depends on them.
fn changed() -> String {
    let status = ["status", "--porcelain", "-uno", "--"];
    let mut command = Command::new("git");
    output(command.args(status).args([
        ":/",
        ":(top,exclude)bench/results",
        ":(top,exclude)bench/README.md",
    ]))
}

/// Which commit was measured, for a summary: a sentence.
#[must_use]
pub fn commit_in_words(commit: Option<&str>, facts: &Value) -> String {
    match (commit, &facts["uncommitted_changes"]) {
        (None | Some(""), _) => "Commit: not known.".into(),
        (Some(commit), Value::Bool(true)) => {
            format!("Commit: {commit}, with changes that are not in it.")
        }
        (Some(commit), _) => format!("Commit: {commit}."),
    }
}

/// First line that a command prints; empty if it cannot run.
pub(crate) fn output(command: &mut Command) -> String {
    let output = command.output().map(|o| o.stdout).unwrap_or_default();
    String::from_utf8_lossy(&output)
        .lines()
        .next()
        .unwrap_or_default()
        .trim()
        .to_owned()
}

fn read(path: &str) -> String {
    fs::read_to_string(path).unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_summary_says_which_commit_and_what_it_does_not_hold() {
        let said = |commit: &str, is_changed: bool| {
            commit_in_words(Some(commit), &json!({ "uncommitted_changes": is_changed }))
        };
        assert_eq!(said("ab12", false), "Commit: ab12.");
        assert_eq!(
            said("ab12", true),
            "Commit: ab12, with changes that are not in it."
        );
        assert_eq!(said("", false), "Commit: not known.");
        assert_eq!(commit_in_words(None, &json!({})), "Commit: not known.");
    }
}
